//! Reports as one self-contained page.

#![allow(missing_docs, reason = "internal to the workspace: most names and types are clear")]

mod axis;
mod document;
pub mod html;
pub mod number;
pub mod plot;

pub use axis::{Quantity, Scale};
pub use document::{Cell, CellKind, Document, Note, Plot, Section, Table};
