pub(super) struct Dictionary<'a> {
    rest: &'a [u8],
}

pub(super) struct Description<'a> {
    pub(super) descr: Descr<'a>,
    pub(super) fortran: bool,
    pub(super) shape: Vec<u64>,
}

pub(super) enum Descr<'a> {
    Plain(&'a [u8]),
    Structured(Vec<Field<'a>>),
}

pub(super) struct Field<'a> {
    pub(super) name: &'a [u8],
    pub(super) kind: &'a [u8],
    pub(super) shape: Vec<u64>,
}

impl<'a> Dictionary<'a> {
    pub(super) fn parse(text: &'a [u8]) -> Result<Description<'a>, &'a [u8]> {
        let mut this = Self { rest: text };
        this.entries().ok_or(this.rest)
    }

    fn entries(&mut self) -> Option<Description<'a>> {
        let (mut descr, mut fortran, mut shape) = (None, None, None);
        self.token(b"{")?;
        while self.token(b"}").is_none() {
            let key = self.string()?;
            self.token(b":")?;
            match key {
                b"descr" => descr = Some(self.descr()?),
                b"fortran_order" => fortran = Some(self.boolean()?),
                b"shape" => shape = Some(self.tuple()?),
                _ => return None,
            }
            let _ = self.token(b",");
        }
        Some(Description { descr: descr?, fortran: fortran?, shape: shape? })
    }

    fn descr(&mut self) -> Option<Descr<'a>> {
        if self.token(b"[").is_none() {
            return self.string().map(Descr::Plain);
        }
        let mut fields = Vec::new();
        while self.token(b"]").is_none() {
            self.token(b"(")?;
            let name = self.string()?;
            self.token(b",")?;
            let kind = self.string()?;
            let shape = if self.token(b",").is_some() { self.tuple()? } else { Vec::new() };
            self.token(b")")?;
            let _ = self.token(b",");
            fields.push(Field { name, kind, shape });
        }
        Some(Descr::Structured(fields))
    }

    fn token(&mut self, token: &[u8]) -> Option<()> {
        self.rest = self.rest.trim_ascii_start();
        self.rest = self.rest.strip_prefix(token)?;
        Some(())
    }

    fn string(&mut self) -> Option<&'a [u8]> {
        let quote = if self.token(b"'").is_some() { b'\'' } else { self.token(b"\"").map(|()| b'"')? };
        let end = memchr::memchr(quote, self.rest)?;
        let (string, rest) = self.rest.split_at(end);
        self.rest = &rest[1..];
        Some(string)
    }

    fn boolean(&mut self) -> Option<bool> {
        let yes = self.token(b"True").is_some();
        (yes || self.token(b"False").is_some()).then_some(yes)
    }

    fn tuple(&mut self) -> Option<Vec<u64>> {
        self.token(b"(")?;
        let mut values = Vec::new();
        while self.token(b")").is_none() {
            self.rest = self.rest.trim_ascii_start();
            let (value, length) = lexical_core::parse_partial(self.rest).ok().filter(|&(_, n)| n > 0)?;
            values.push(value);
            self.rest = &self.rest[length..];
            let _ = self.token(b",");
        }
        Some(values)
    }
}
