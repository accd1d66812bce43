//! A report before it is a page.

/// A report.
#[derive(Clone, Debug, Default)]
pub struct Document {
    /// The title.
    pub title: String,
    /// The sections, in order.
    pub sections: Vec<Section>,
}

/// A figure with its text, plots and tables.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// The title.
    pub title: String,
    /// Paragraphs. Text between backticks is code; a paragraph that begins with "```sh" is a command.
    pub text: Vec<String>,
    /// The plots.
    pub plots: Vec<Plot>,
    /// The tables, below the plots.
    pub tables: Vec<Table>,
    /// Notes: skipped measurements with reasons, and cases in which a peer is faster.
    pub notes: Vec<Note>,
}

/// A note below a figure.
#[derive(Clone, Debug)]
pub struct Note {
    /// The text.
    pub text: String,
    /// `true` for a wrong result.
    pub is_error: bool,
}

/// A plot.
#[derive(Clone, Debug)]
pub struct Plot {
    /// The file name without `.svg`.
    pub name: String,
    /// The caption.
    pub caption: String,
    /// The plot as SVG.
    pub svg: String,
}

/// A table.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// The caption.
    pub caption: String,
    /// The names of the columns.
    pub header: Vec<String>,
    /// Rows, with a cell per column.
    pub rows: Vec<Vec<Cell>>,
}

/// A cell of a table.
#[derive(Clone, Debug)]
pub struct Cell {
    /// The text.
    pub text: String,
    /// The style.
    pub kind: Kind,
}

/// The style of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Plain.
    Plain,
    /// The best value.
    Best,
    /// Not measured.
    Absent,
    /// A wrong answer.
    Error,
}

impl Cell {
    /// Creates a plain cell.
    pub fn plain(text: impl Into<String>) -> Self {
        Self { text: text.into(), kind: Kind::Plain }
    }
}
