pub(crate) mod calibrate;
pub(crate) mod check;
pub(crate) mod detect;
pub(crate) mod devices;
pub(crate) mod generate;
pub(crate) mod page;
pub(crate) mod simulate;
