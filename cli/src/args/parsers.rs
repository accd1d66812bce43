use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use lazygrid::{Skin, UnknownName};
use lazygrid_io::write::TableFormat;

pub(super) fn one_of<T>(names: impl IntoIterator<Item = &'static str>) -> impl TypedValueParser<Value = T>
where
    T: FromStr<Err = UnknownName> + Clone + Send + Sync + 'static,
{
    PossibleValuesParser::new(names).try_map(|name| name.parse())
}

pub(super) fn table_format() -> impl TypedValueParser<Value = TableFormat> {
    PossibleValuesParser::new(["csv", "npy"])
        .map(|name| if name == "npy" { TableFormat::Npy } else { TableFormat::Csv })
}

pub(super) fn tilts(text: &str) -> Result<[f64; 3], String> {
    let tilt = |text: &str| f64::from_str(text.trim()).ok().filter(|tilt| tilt.is_finite());
    let tilts: Option<Vec<_>> = text.split(',').map(tilt).collect();
    let tilts = tilts.and_then(|tilts| tilts.try_into().ok());
    tilts.ok_or_else(|| "expected three numbers, such as 2.5,0,0".to_owned())
}

pub(super) fn threads(text: &str) -> Result<NonZeroUsize, String> {
    text.parse().map_err(|_| "expected a whole number above zero; leave it out to use all threads".to_owned())
}

pub(super) fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = f64::from_str(text).ok().filter(|seconds| *seconds > 0.0);
    let time = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    time.ok_or_else(|| "expected a number of seconds above zero".to_owned())
}

pub(super) fn cell_ratio(text: &str) -> Result<f32, String> {
    let ratio = f32::from_str(text).ok().filter(|ratio| (0.5..=16.0).contains(ratio));
    ratio.ok_or_else(|| "expected a number from 0.5 to 16".to_owned())
}

pub(super) fn skin(text: &str) -> Result<Skin, String> {
    let distance = || f64::from_str(text).ok().filter(|distance| *distance > 0.0).map(Skin::Fixed);
    match text {
        "off" => Ok(Skin::Off),
        "auto" => Ok(Skin::Auto),
        _ => distance().ok_or_else(|| "expected off, auto, or a distance above zero".to_owned()),
    }
}

/// Parses a path whose extension names a format; the text lists the extensions.
#[derive(Clone)]
pub(super) struct PathWith<T>(pub(super) fn(&Path) -> Option<T>, pub(super) &'static str);

impl<T: Clone + Send + Sync + 'static> TypedValueParser for PathWith<T> {
    type Value = (PathBuf, T);

    fn parse_ref(
        &self,
        command: &clap::Command,
        _: Option<&clap::Arg>,
        value: &std::ffi::OsStr,
    ) -> Result<Self::Value, clap::Error> {
        let path = PathBuf::from(value);
        match (self.0)(&path) {
            Some(format) => Ok((path, format)),
            None => {
                let message = format!("'{}' does not end in {}\n", path.display(), self.1);
                Err(clap::Error::raw(clap::error::ErrorKind::ValueValidation, message).with_cmd(command))
            }
        }
    }
}
