use std::collections::VecDeque;

use crate::Error;

#[derive(Debug)]
pub(crate) struct SmallCache<K, V> {
    made: VecDeque<(K, V)>,
    current: usize,
}

impl<K: PartialEq, V> SmallCache<K, V> {
    const MOST: usize = 4;

    pub(crate) const NONE: Self = Self { made: VecDeque::new(), current: 0 };

    pub(crate) fn get_or_insert_with(
        &mut self,
        key: K,
        make: impl FnOnce(&K) -> Result<V, Error>,
    ) -> Result<(), Error> {
        self.current = match self.made.iter().position(|(known, _)| *known == key) {
            Some(position) => position,
            None => {
                let value = make(&key)?;
                self.made.truncate(Self::MOST - 1);
                self.made.push_front((key, value));
                0
            }
        };
        Ok(())
    }

    pub(crate) fn current(&self) -> Option<&V> {
        self.made.get(self.current).map(|(_, value)| value)
    }
}
