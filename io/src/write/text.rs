use std::io::{self, Write};

use lexical_core::ToLexical;

pub(super) struct Rows<W> {
    out: W,
    gathered: Vec<u8>,
}

impl<W: Write> Rows<W> {
    const BLOCK: usize = 1 << 16;

    pub(super) fn new(out: W) -> Self {
        Self { out, gathered: Vec::with_capacity(2 * Self::BLOCK) }
    }

    pub(super) fn row<T: ToLexical, const N: usize>(
        &mut self,
        values: [T; N],
        separator: u8,
    ) -> io::Result<()> {
        for (k, value) in values.into_iter().enumerate() {
            if k > 0 {
                self.gathered.push(separator);
            }
            let start = self.gathered.len();
            self.gathered.resize(start + T::FORMATTED_SIZE, 0);
            let length = lexical_core::write(value, &mut self.gathered[start..]).len();
            self.gathered.truncate(start + length);
        }
        self.gathered.push(b'\n');
        if self.gathered.len() >= Self::BLOCK { self.flush() } else { Ok(()) }
    }

    pub(super) fn flush(&mut self) -> io::Result<()> {
        self.out.write_all(&self.gathered)?;
        self.gathered.clear();
        Ok(())
    }
}
