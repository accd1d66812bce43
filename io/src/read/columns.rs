use super::line::Line;
use super::read_context::ReadContext;
use crate::error::{Error, excerpt};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Column {
    Axis(usize),
    Scaled(usize),
    Radius,
    Diameter,
    Species,
    Id,
    Group,
    Other,
}

impl Column {
    pub(super) fn named(name: &str) -> Self {
        match name.to_ascii_lowercase().as_str() {
            "x" => Self::Axis(0),
            "y" => Self::Axis(1),
            "z" => Self::Axis(2),
            "r" | "radius" | "radii" => Self::Radius,
            "diameter" => Self::Diameter,
            "species" => Self::Species,
            "id" => Self::Id,
            "group" | "molecule" | "mol" => Self::Group,
            _ => Self::Other,
        }
    }
}

pub(super) struct Columns {
    meanings: Vec<Column>,
    names: Vec<String>,
    open_ended: bool,
}

#[derive(Clone, Copy, Default)]
pub(super) struct Row<'a> {
    pub(super) center: [f64; 3],
    pub(super) scaled: [Scaled<'a>; 3],
    pub(super) radius: Option<f64>,
    pub(super) species: Option<&'a [u8]>,
    pub(super) id: Option<&'a [u8]>,
    pub(super) group: Option<&'a [u8]>,
    /// First rounded column, and its field.
    pub(super) rounded: Option<(usize, &'a [u8])>,
}

#[derive(Clone, Copy, Default)]
pub(super) struct Scaled<'a> {
    pub(super) value: f64,
    /// Unit of the last digit; infinite for at most [`SAFE_DIGITS`].
    pub(super) unit: f64,
    pub(super) field: Option<(usize, &'a [u8])>,
}

impl<'a> Scaled<'a> {
    fn new(value: f64, (column, field): (usize, &'a [u8])) -> Self {
        let unit = digits(field).filter(|&(significant, _)| significant > SAFE_DIGITS);
        Self { value, unit: unit.map_or(f64::INFINITY, |(_, unit)| unit), field: Some((column, field)) }
    }
}

impl Columns {
    pub(super) fn new(columns: impl IntoIterator<Item = (String, Column)>) -> Self {
        let (names, meanings) = columns.into_iter().unzip();
        Self { meanings, names, open_ended: false }
    }

    pub(super) fn open_ended(self) -> Self {
        Self { open_ended: true, ..self }
    }

    pub(super) fn has(&self, meaning: Column) -> bool {
        self.meanings.contains(&meaning)
    }

    pub(super) fn name(&self, column: usize) -> &str {
        &self.names[column]
    }

    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    pub(super) fn check(&self, header: Line<'_>, context: &ReadContext) -> Result<(), Error> {
        let found = || format!("columns {}", excerpt(self.names.join(", ").as_bytes()));
        match self.lacks(context) {
            Some(expected) => Err(Error::Syntax { location: header.location(), expected, found: found() }),
            None => Ok(()),
        }
    }

    pub(super) fn lacks(&self, context: &ReadContext) -> Option<String> {
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            if !self.has(Column::Axis(axis)) && !self.has(Column::Scaled(axis)) {
                return Some(format!("a column `{name}`"));
            }
        }
        let count = |wanted: &[Column]| self.meanings.iter().filter(|m| wanted.contains(m)).count();
        let axes = [0, 1, 2].map(|axis| count(&[Column::Axis(axis), Column::Scaled(axis)]));
        let radii = count(&[Column::Radius, Column::Diameter]);
        if axes != [1; 3] || radii > 1 || count(&[Column::Species]) > 1 || count(&[Column::Id]) > 1 {
            return Some("one column each for x, y, z, species, id and either radius or diameter".to_owned());
        }
        let by_species = self.has(Column::Species) && context.species.has_radii();
        if radii == 0 && !by_species {
            let remedy =
                if self.has(Column::Species) { ", or radii by species (--radius SPECIES=R)" } else { "" };
            return Some(format!("a radius column{remedy}"));
        }
        if context.groups && count(&[Column::Group]) != 1 {
            return Some(
                "one column `group`, `molecule` or `mol`, which --exclude-groups asks for".to_owned(),
            );
        }
        (context.ids && !self.has(Column::Id)).then(|| "a column `id`, which --ids asks for".to_owned())
    }

    pub(super) fn row<'a>(
        &self,
        line: Line<'a>,
        mut fields: impl Iterator<Item = &'a [u8]>,
        doubles: bool,
    ) -> Result<Row<'a>, Error> {
        let mut row = Row::default();
        for (k, meaning) in self.meanings.iter().enumerate() {
            let Some(field) = fields.next() else {
                return Err(self.wrong_width(line, k));
            };
            let name = &self.names[k];
            let value = match *meaning {
                Column::Axis(axis) => {
                    row.center[axis] = line.real(name, field, doubles)?;
                    row.center[axis]
                }
                Column::Radius | Column::Diameter => {
                    let value = line.radius(name, field, doubles)?;
                    row.radius = Some(if *meaning == Column::Radius { value } else { value * 0.5 });
                    value
                }
                Column::Scaled(axis) => {
                    row.scaled[axis] = Scaled::new(line.number(name, field)?, (k, field));
                    continue;
                }
                Column::Species => {
                    row.species = Some(field);
                    continue;
                }
                Column::Id => {
                    row.id = Some(field);
                    continue;
                }
                Column::Group => {
                    row.group = Some(field);
                    continue;
                }
                Column::Other => continue,
            };
            let is_safe = field.len() <= SAFE_DIGITS as usize && value.abs() >= SMALLEST_NORMAL;
            if !doubles && !is_safe && row.rounded.is_none() && loses_digits(field, value as f32) {
                row.rounded = Some((k, field));
            }
        }
        if !self.open_ended && fields.next().is_some() {
            return Err(self.wrong_width(line, self.meanings.len() + 1 + fields.count()));
        }
        Ok(row)
    }

    fn wrong_width(&self, line: Line<'_>, found: usize) -> Error {
        let (width, names) = (self.names.len(), excerpt(self.names.join(", ").as_bytes()));
        let expected = format!("{width} fields ({names})");
        let found = format!("{found}: '{}'", excerpt(line.bytes));
        Error::Syntax { location: line.location(), expected, found }
    }
}

/// Normal numbers of at most this many digits survive a conversion to `f32` (FLT_DIG of C).
const SAFE_DIGITS: u32 = 6;
const SMALLEST_NORMAL: f64 = f32::MIN_POSITIVE as f64;

/// Returns `true` if `value`, written with the field's number of significant digits, is another number.
/// Text of `%.9g` loses none.
fn loses_digits(field: &[u8], value: f32) -> bool {
    let may_lose = |&(significant, _): &(u32, f64)| significant > SAFE_DIGITS || !value.is_normal();
    let Some((_, unit)) = digits(field).filter(may_lose) else { return false };
    let Ok(wide) = lexical_core::parse::<f64>(field) else { return false };
    // Ties may round either way, and `wide` and `unit` have errors.
    let error = 1e-9 * unit + wide.abs() * f64::EPSILON;
    (wide - f64::from(value)).abs() > 0.5 * unit + error
}

/// Returns the significant digits, without trailing zeros, and the unit of the last; `None` for zero.
fn digits(field: &[u8]) -> Option<(u32, f64)> {
    let end = field.iter().position(|b| b"eE".contains(b));
    let (mantissa, exponent) = field.split_at(end.unwrap_or(field.len()));
    let exponent: i32 = exponent.get(1..).map_or(Some(0), |exponent| lexical_core::parse(exponent).ok())?;
    let (mut all, mut point, mut first, mut last) = (0_i32, None, None, 0);
    for &b in mantissa {
        match b {
            b'.' => point = Some(all),
            b'0' => all += 1,
            b'1'..=b'9' => {
                first = first.or(Some(all));
                last = all;
                all += 1;
            }
            _ => {}
        }
    }
    let significant = (last - first? + 1) as u32;
    Some((significant, 10_f64.powi((point.unwrap_or(all) - 1 - last).saturating_add(exponent))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_that_are_lost() {
        for (field, lost) in [
            ("0.1234567890123", true),
            ("-1.2000000000000000e+01", false),
            ("1234567890123", true),
            ("12345678900000", true),
            ("1.0000000e-30", false),
            ("1.00000001e-30", true),
            ("0.000000000000001", false),
            ("0.00048828125", false),
            ("1.00048828125", false),
            ("1.000488281251", true),
            ("16777216", false),
            ("16777217", true),
            ("-16777217.0", true),
            ("1.6777217E+7", true),
            ("0.1", false),
            ("123.456", false),
            ("8589973000", true),
            ("0.0000", false),
            ("100000.01", false),
            ("100000.001", true),
            ("0.12345678e-2147483648", false),
            ("1e-50", true),
            ("-1.5e-45", true),
            ("1e-45", false),
        ] {
            let value = field.parse().unwrap();
            assert_eq!(loses_digits(field.as_bytes(), value), lost, "{field}");
        }
    }

    #[test]
    fn digits_of_32_bit_numbers_are_kept() {
        let mut bits = 1_u32;
        for _ in 0..100_000 {
            bits = bits.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let value = f32::from_bits(bits);
            if value.is_normal() {
                for text in [
                    format!("{value:.8e}"),
                    format!("{value:e}"),
                    format!("{value}"),
                    format!("{value:.16e}"),
                ] {
                    let read = text.parse().unwrap();
                    assert_eq!(read, value);
                    assert!(!loses_digits(text.as_bytes(), read), "{text}");
                }
            }
        }
    }
}
