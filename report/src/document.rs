//! A report as data.

/// A report.
#[derive(Clone, Debug, Default)]
pub struct Document {
    /// Title.
    pub title: String,
    /// Sections, in order.
    pub sections: Vec<Section>,
}

/// A figure with its text, plots and tables.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// Title.
    pub title: String,
    /// Paragraphs. Backticks mark code; "```sh" begins a command.
    pub text: Vec<String>,
    /// Plots.
    pub plots: Vec<Plot>,
    /// Tables, below the plots.
    pub tables: Vec<Table>,
    /// Notes on skipped measurements and faster peers.
    pub notes: Vec<Note>,
}

/// A note below a figure.
#[derive(Clone, Debug)]
pub struct Note {
    /// Text.
    pub text: String,
    /// Marks a wrong result.
    pub is_error: bool,
}

/// A plot.
#[derive(Clone, Debug)]
pub struct Plot {
    /// File name without `.svg`.
    pub name: String,
    /// Caption.
    pub caption: String,
    /// Plot as SVG.
    pub svg: String,
}

/// A table.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// Caption.
    pub caption: String,
    /// Names of the columns.
    pub header: Vec<String>,
    /// Rows of cells.
    pub rows: Vec<Vec<Cell>>,
}

/// A cell of a table.
#[derive(Clone, Debug)]
pub struct Cell {
    /// Text.
    pub text: String,
    /// Style.
    pub kind: Kind,
}

/// The style of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Plain.
    Plain,
    /// Best value.
    Best,
    /// Not measured.
    Absent,
    /// Wrong answer.
    Error,
}

impl Cell {
    /// Creates a plain cell.
    pub fn plain(text: impl Into<String>) -> Self {
        Self { text: text.into(), kind: Kind::Plain }
    }
}
