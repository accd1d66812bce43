//! A report before it is a page.

/// The whole report.
#[derive(Clone, Debug, Default)]
pub struct Document {
    /// Its title.
    pub title: String,
    /// Its sections, in order.
    pub sections: Vec<Section>,
}

/// A figure with what belongs to it.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// Its title.
    pub title: String,
    /// Paragraphs, in which what stands between two backticks is code; one that begins with "```sh" is a command.
    pub text: Vec<String>,
    /// Pictures.
    pub plots: Vec<Plot>,
    /// Tables, below the pictures.
    pub tables: Vec<Table>,
    /// What could not be measured and why, and where somebody else is faster.
    pub notes: Vec<Note>,
}

/// A sentence below a figure.
#[derive(Clone, Debug)]
pub struct Note {
    /// What it says.
    pub text: String,
    /// `true` if something is wrong.
    pub is_error: bool,
}

/// A picture.
#[derive(Clone, Debug)]
pub struct Plot {
    /// The file's name without `.svg`.
    pub name: String,
    /// What it shows.
    pub caption: String,
    /// The picture as SVG.
    pub svg: String,
}

/// A table.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// What it shows.
    pub caption: String,
    /// The names of the columns.
    pub header: Vec<String>,
    /// A cell for each column.
    pub rows: Vec<Vec<Cell>>,
}

/// A cell of a table.
#[derive(Clone, Debug)]
pub struct Cell {
    /// What it says.
    pub text: String,
    /// How it is shown.
    pub kind: Kind,
}

/// How a cell is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// As it is.
    Plain,
    /// The best of its kind.
    Best,
    /// Not measured.
    Absent,
    /// A wrong answer.
    Error,
}

impl Cell {
    /// One that is shown as it is.
    pub fn plain(text: impl Into<String>) -> Self {
        Self { text: text.into(), kind: Kind::Plain }
    }
}
