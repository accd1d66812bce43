//! A report before it is Markdown or HTML.

/// The whole report.
pub(super) struct Document {
    pub(super) title: String,
    pub(super) sections: Vec<Section>,
}

/// A figure with what belongs to it.
#[derive(Default)]
pub(super) struct Section {
    pub(super) title: String,
    pub(super) text: Vec<String>,
    pub(super) plots: Vec<Plot>,
    pub(super) tables: Vec<Table>,
    /// What could not be measured and why, and where somebody else is faster.
    pub(super) notes: Vec<Note>,
}

/// A sentence below a figure.
pub(super) struct Note {
    pub(super) text: String,
    pub(super) is_error: bool,
}

/// A picture.
pub(super) struct Plot {
    /// The file's name without `.svg`.
    pub(super) name: String,
    pub(super) caption: String,
    pub(super) svg: String,
}

/// A table.
#[derive(Default)]
pub(super) struct Table {
    pub(super) caption: String,
    pub(super) header: Vec<String>,
    pub(super) rows: Vec<Vec<Cell>>,
}

/// A cell of a table.
#[derive(Clone)]
pub(super) struct Cell {
    pub(super) text: String,
    pub(super) kind: Kind,
}

/// How a cell is shown.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Plain,
    /// The best of its kind.
    Best,
    /// Not measured.
    Absent,
    /// A wrong answer.
    Error,
}

impl Cell {
    pub(super) fn plain(text: impl Into<String>) -> Self {
        Self { text: text.into(), kind: Kind::Plain }
    }
}
