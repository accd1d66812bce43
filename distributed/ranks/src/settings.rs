//! Settings that all ranks must share.
//!
//! # Correctness
//!
//! 1. A setting has a 64-bit digest of its name and value, independent of builds, seeds and addresses.
//! 2. Numbers enter exactly: as the shortest decimal text that reads back, or as bits. −0 counts as 0.
//!    Spaces, tables and bounds refuse NaN.
//! 3. All ranks compare all digests by the same rule, so all see the same difference or none. Then two of them send
//!    the texts.
//! 4. Unequal values collide with a probability of about 2⁻⁶⁴.

use std::fmt::{self, Write};

use lazygrid::{Interaction, Interactions, Space};

use crate::hash::sequence;
use crate::{Communicator, Difference};

/// Settings in the order of comparison. An empty text is no value.
///
/// ```
/// # use lazygrid_ranks::{Communicator, Settings, threads};
/// let errors = threads::on(3, |mut rank| {
///     let steps = if rank.rank() == 2 { 50 } else { 100 };
///     Settings::new("1.0").with("steps", steps).agree(&mut rank).unwrap_err()
/// });
/// let expected = "rank 0: the setting `steps` is 100 on rank 0 and 50 on rank 2; 1 of 3 ranks differs from rank 0; \
///                 give all ranks the same";
/// assert_eq!(errors, [expected; 3]);
/// ```
#[derive(Clone, Debug)]
pub struct Settings {
    each: Vec<Setting>,
}

#[derive(Clone, Debug)]
struct Setting {
    name: &'static str,
    text: String,
    digest: u64,
}

impl Settings {
    /// Begins with the program's version, since versions may differ in data layouts.
    pub fn new(version: impl fmt::Display) -> Self {
        Self { each: Vec::new() }.with("version", version)
    }

    /// `value` is the complete text.
    pub fn with(self, name: &'static str, value: impl fmt::Display) -> Self {
        let text = value.to_string();
        let digest = sequence(words(name).chain(words(&text)));
        self.add(Setting { name, text, digest })
    }

    /// Shows `what` the value is and a digest in place of a long text.
    pub fn with_long(self, name: &'static str, what: impl fmt::Display, value: impl fmt::Display) -> Self {
        self.with_words(name, what, words(&value.to_string()))
    }

    pub fn with_space(self, space: &Space) -> Self {
        self.with("space", describe(space))
    }

    pub fn with_interactions(self, table: Option<&Interactions>) -> Self {
        let name = "interactions";
        let Some(table) = table else { return self.with(name, "no table") };
        let species = table.species();
        let pairs = (0..species).flat_map(|a| (a..species).map(move |b| (a, b)));
        let entries = pairs.flat_map(|(a, b)| entry(table.get(a, b)));
        self.with_words(name, format_args!("a table of {species} species"), entries)
    }

    fn with_words(
        self,
        name: &'static str,
        what: impl fmt::Display,
        value: impl IntoIterator<Item = u64>,
    ) -> Self {
        let digest = sequence(words(name).chain(value));
        self.add(Setting { name, text: format!("{what} with the digest {digest:016x}"), digest })
    }

    fn add(mut self, setting: Setting) -> Self {
        self.each.push(setting);
        self
    }

    /// Compares the settings of all ranks. Collective.
    ///
    /// # Errors
    /// [`Communicator::difference`] on all ranks for a difference; the communicator's.
    pub fn agree<C: Communicator>(&self, communicator: &mut C) -> Result<(), C::Error> {
        let digests: Vec<u64> = self.each.iter().map(|setting| setting.digest).collect();
        let (all, counts) = communicator.all_gather("digests of settings", &digests)?;
        let of_ranks: Vec<&[u64]> = split(&all, &counts).collect();
        let Some((index, other)) = first_difference(&of_ranks) else { return Ok(()) };
        let at = |rank: usize| of_ranks[rank].get(index);
        let differing = (0..of_ranks.len()).filter(|&rank| at(rank) != at(0)).count() as u32;
        let ranks = [0, other as u32];
        // Other programs may lack the setting.
        let local_setting = self.each.get(index).filter(|_| ranks.contains(&communicator.rank()));
        let (name, text) = local_setting.map_or(("", ""), |setting| (setting.name, &setting.text));
        let names = communicator.all_gather("names of settings", name.as_bytes())?;
        let texts = communicator.all_gather("settings that differ", text.as_bytes())?;
        let [names, values] = [names, texts].map(|(bytes, counts)| {
            let texts: Vec<_> =
                split(&bytes, &counts).map(String::from_utf8_lossy).map(String::from).collect();
            ranks.map(|rank| texts[rank as usize].clone())
        });
        let setting = names.into_iter().find(|name| !name.is_empty()).unwrap_or_default();
        let values = values.map(|value| if value.is_empty() { "not known".to_owned() } else { value });
        let all = communicator.ranks();
        let error = communicator.difference(Difference { setting, ranks, values, differing, all });
        communicator.agree(Err(error))
    }
}

fn split<'a, T>(all: &'a [T], counts: &'a [usize]) -> impl Iterator<Item = &'a [T]> {
    let mut rest = all;
    counts.iter().map(move |&count| {
        let (segment, others) = rest.split_at(count);
        rest = others;
        segment
    })
}

fn first_difference(of_ranks: &[&[u64]]) -> Option<(usize, usize)> {
    let first = of_ranks.first()?;
    let count = of_ranks.iter().map(|digests| digests.len()).max()?;
    (0..count).find_map(|index| {
        of_ranks.iter().position(|digests| digests.get(index) != first.get(index)).map(|rank| (index, rank))
    })
}

fn words(text: &str) -> impl Iterator<Item = u64> {
    let word = |bytes: &[u8]| bytes.iter().rev().fold(0, |word, &byte| word << 8 | u64::from(byte));
    std::iter::once(text.len() as u64).chain(text.as_bytes().chunks(8).map(word))
}

/// Uses 0 for −0.
fn entry(interaction: Interaction) -> [u64; 2] {
    match interaction {
        Interaction::Never => [0, 0],
        Interaction::Touch => [1, 0],
        Interaction::Within(distance) => [2, (distance + 0.0).to_bits()],
    }
}

/// Uses 0 for −0.
fn describe(space: &Space) -> String {
    if !space.is_periodic() {
        return "unbounded".to_owned();
    }
    let mut text = "periodic along".to_owned();
    for vector in space.cell_vectors() {
        let _ = match vector.map(|vector| vector.map(|length| length + 0.0)) {
            Some([x, y, z]) => write!(text, " ({x}, {y}, {z})"),
            None => write!(text, " -"),
        };
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn digest(settings: Settings) -> u64 {
        settings.each.last().unwrap().digest
    }

    #[test]
    fn digests_are_those_of_every_build() {
        let none = || Settings::new("1");
        assert_eq!(digest(none().with("steps", 100)), 0xA623_CC9B_5314_503E);
        assert_eq!(digest(none().with_space(&Space::UNBOUNDED)), 0x4862_1F8E_8DA6_EE67);
        let mut table = Interactions::new(2, Interaction::Touch).unwrap();
        table.set(0, 1, Interaction::Within(2.5)).unwrap();
        assert_eq!(digest(none().with_interactions(Some(&table))), 0x8A9E_2E89_5C13_DC4C);
    }

    #[test]
    fn equal_settings_have_equal_digests() {
        let tilted = |tilt: f64| {
            let vectors = [[4.0, 0.0, 0.0], [tilt, 4.0, 0.0], [1.0, 0.0, 4.0]];
            Settings::new("1").with_space(&Space::triclinic(vectors.map(Some)).unwrap())
        };
        assert_eq!(digest(tilted(0.0)), digest(tilted(-0.0)));
        assert_ne!(digest(tilted(0.0)), digest(tilted(f64::from_bits(1))));
        let within = |distance: f64| {
            let table = Interactions::new(1, Interaction::Within(distance)).unwrap();
            digest(Settings::new("1").with_interactions(Some(&table)))
        };
        assert_eq!(within(0.0), within(-0.0));
        assert_ne!(within(1.0), within(1.0_f64.next_up()));
    }

    #[test]
    fn spaces_are_described_in_full() {
        let space = Space::periodic([Some(10.0), None, Some(0.1)]).unwrap();
        assert_eq!(describe(&space), "periodic along (10, 0, 0) - (0, 0, 0.1)");
        assert_eq!(describe(&Space::UNBOUNDED), "unbounded");
    }

    #[test]
    fn texts_that_are_cut_differently_have_different_digests() {
        let digest_of = |texts: &[&str]| sequence(texts.iter().flat_map(|text| words(text)));
        let texts: [&[&str]; 5] = [&["ab", "c"], &["a", "bc"], &["abc", ""], &["abc"], &["abc\0"]];
        for (k, one) in texts.iter().enumerate() {
            assert!(texts[..k].iter().all(|other| digest_of(other) != digest_of(one)), "{one:?}");
        }
    }
}
