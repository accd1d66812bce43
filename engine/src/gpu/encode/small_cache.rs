use std::collections::VecDeque;

use crate::Error;

/// The last few values, for callers that alternate between a few buffers.
#[derive(Debug)]
pub(crate) struct SmallCache<K, V> {
    made: VecDeque<(K, V)>,
    /// The index of the value that was requested last.
    current: usize,
}

impl<K: PartialEq, V> SmallCache<K, V> {
    const MOST: usize = 4;

    pub(crate) const NONE: Self = Self { made: VecDeque::new(), current: 0 };

    /// Selects the value of `key`, created by `make` if it is absent.
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
