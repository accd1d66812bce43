use std::collections::VecDeque;

use crate::Error;

#[derive(Debug)]
pub(crate) struct SmallCache<K, V> {
    entries: VecDeque<(K, V)>,
    current: usize,
}

impl<K: PartialEq, V> SmallCache<K, V> {
    const CAPACITY: usize = 4;

    pub(crate) const NONE: Self = Self { entries: VecDeque::new(), current: 0 };

    pub(crate) fn get_or_insert_with(
        &mut self,
        key: K,
        make: impl FnOnce(&K) -> Result<V, Error>,
    ) -> Result<(), Error> {
        self.current = match self.entries.iter().position(|(known, _)| *known == key) {
            Some(position) => position,
            None => {
                let value = make(&key)?;
                self.entries.truncate(Self::CAPACITY - 1);
                self.entries.push_front((key, value));
                0
            }
        };
        Ok(())
    }

    pub(crate) fn current(&self) -> Option<&V> {
        self.entries.get(self.current).map(|(_, value)| value)
    }
}
