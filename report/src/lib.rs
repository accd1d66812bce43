//! Reports of figures and simulations: text, tables and plots as one self-contained page.
//!
//! A [`Document`] is plain data; [`plot::lines`] draws a [`Plot`] and [`html::page`] makes the page.

mod axis;
mod document;
pub mod html;
pub mod number;
pub mod plot;

pub use axis::{Quantity, Scale};
pub use document::{Cell, Document, Kind, Note, Plot, Section, Table};
