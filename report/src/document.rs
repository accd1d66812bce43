#[derive(Clone, Debug, Default)]
pub struct Document {
    pub title: String,
    pub sections: Vec<Section>,
}

#[derive(Clone, Debug, Default)]
pub struct Section {
    pub title: String,
    /// Paragraphs. Backticks mark code; "```sh" begins a command.
    pub text: Vec<String>,
    pub plots: Vec<Plot>,
    pub tables: Vec<Table>,
    pub notes: Vec<Note>,
}

#[derive(Clone, Debug)]
pub struct Note {
    pub text: String,
    pub is_error: bool,
}

#[derive(Clone, Debug)]
pub struct Plot {
    /// File name without `.svg`.
    pub name: String,
    pub caption: String,
    pub svg: String,
}

#[derive(Clone, Debug, Default)]
pub struct Table {
    pub caption: String,
    pub header: Vec<String>,
    pub rows: Vec<Vec<Cell>>,
}

#[derive(Clone, Debug)]
pub struct Cell {
    pub text: String,
    pub kind: CellKind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellKind {
    Plain,
    Best,
    Absent,
    Error,
}

impl Cell {
    pub fn plain(text: impl Into<String>) -> Self {
        Self { text: text.into(), kind: CellKind::Plain }
    }
}
