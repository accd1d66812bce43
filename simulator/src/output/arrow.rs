//! The log as Arrow IPC files, written at the end of a run, since they cannot be appended to.

use std::collections::HashMap;
use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;

use arrow_array::types::Int32Type;
use arrow_array::{
    ArrayRef, DictionaryArray, Float64Array, RecordBatch, StringArray, UInt32Array, UInt64Array,
};
use arrow_ipc::writer::FileWriter;
use arrow_schema::{ArrowError, DataType, Field, Schema};

use super::directory::ARROW_MARK;
use super::write_atomically;
use crate::output::table::{TableReader, TableRow};
use crate::{Error, Model};

pub(super) const FILE_NAMES: [&str; 2] = ["arrivals.arrow", "releases.arrow"];
const BATCH_ROWS: usize = 1 << 16;

#[derive(Clone)]
enum ColumnKind {
    Whole,
    Large,
    Number,
    Name(Arc<StringArray>),
}

struct Column {
    name: &'static str,
    kind: ColumnKind,
    nullable: bool,
}

pub(super) fn convert(directory: &Path, model: &Model) -> Result<(), Error> {
    let name_kind = |names: Vec<&str>| ColumnKind::Name(Arc::new(StringArray::from(names)));
    let receivers = name_kind(model.receivers.iter().map(|receiver| &receiver.name[..]).collect());
    let species = name_kind(model.species.iter().map(|species| &species.name[..]).collect());
    let transmitters =
        name_kind(model.transmitters.iter().map(|transmitter| &transmitter.name[..]).collect());
    let column = |name, kind: &ColumnKind, nullable| Column { name, kind: kind.clone(), nullable };
    let arrivals = [
        column("step", &ColumnKind::Whole, false),
        column("time", &ColumnKind::Number, false),
        column("receiver", &receivers, false),
        column("species", &species, false),
        column("id", &ColumnKind::Whole, false),
        column("transmitter", &transmitters, true),
        column("released", &ColumnKind::Number, true),
    ];
    let releases = [
        column("step", &ColumnKind::Whole, false),
        column("time", &ColumnKind::Number, false),
        column("transmitter", &transmitters, false),
        column("species", &species, false),
        column("count", &ColumnKind::Large, false),
    ];
    for (name, columns) in FILE_NAMES.into_iter().zip([&arrivals[..], &releases]) {
        let from = directory.join(name).with_extension("csv");
        let mut lines = TableReader::open(
            &from,
            &columns.iter().map(|column| column.name).collect::<Vec<_>>().join(","),
            // Only the rows of a batch stay in memory.
            0,
        )?;
        let mut damaged = None;
        write_atomically(&directory.join(name), |out| {
            write(out, columns, || match lines.next_row() {
                Ok(line) => Ok(line),
                Err(error) => {
                    let message = error.to_string();
                    damaged = Some(error);
                    Err(io::Error::other(message))
                }
            })
        })
        .map_err(|error| damaged.unwrap_or(error))?;
    }
    Ok(())
}

fn write<'a>(
    out: &mut impl Write,
    columns: &[Column],
    mut next: impl FnMut() -> io::Result<Option<TableRow<'a>>>,
) -> io::Result<()> {
    let fields =
        columns.iter().map(|column| Field::new(column.name, column.kind.data_type(), column.nullable));
    let mark = HashMap::from([ARROW_MARK.map(str::to_owned).into()]);
    let schema = Arc::new(Schema::new_with_metadata(fields.collect::<Vec<_>>(), mark));
    let mut file = FileWriter::try_new(out, &schema).map_err(other)?;
    loop {
        let mut lines = Vec::new();
        while lines.len() < BATCH_ROWS {
            let Some(line) = next()? else { break };
            lines.push(line);
        }
        if lines.is_empty() {
            return file.finish().map_err(other);
        }
        let arrays = columns.iter().enumerate().map(|(k, column)| column.kind.array(k, &lines));
        let arrays = arrays.collect::<io::Result<Vec<_>>>()?;
        let batch = RecordBatch::try_new(Arc::clone(&schema), arrays).map_err(other)?;
        file.write(&batch).map_err(other)?;
    }
}

fn other(error: ArrowError) -> io::Error {
    match error {
        ArrowError::IoError(_, source) => source,
        error => io::Error::other(error),
    }
}

impl ColumnKind {
    fn data_type(&self) -> DataType {
        match self {
            Self::Whole => DataType::UInt32,
            Self::Large => DataType::UInt64,
            Self::Number => DataType::Float64,
            // Some readers refuse unsigned keys.
            Self::Name(_) => DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8)),
        }
    }

    fn array(&self, column: usize, lines: &[TableRow<'_>]) -> io::Result<ArrayRef> {
        fn numbers<T: std::str::FromStr>(
            column: usize,
            lines: &[TableRow<'_>],
        ) -> io::Result<Vec<Option<T>>> {
            let number = |line: &TableRow<'_>| match line.field(column) {
                "" => Ok(None),
                _ => line.number(column).map(Some).map_err(|error| io::Error::other(error.to_string())),
            };
            lines.iter().map(number).collect()
        }
        Ok(match self {
            Self::Whole => Arc::new(UInt32Array::from(numbers(column, lines)?)),
            Self::Large => Arc::new(UInt64Array::from(numbers(column, lines)?)),
            Self::Number => Arc::new(Float64Array::from(numbers(column, lines)?)),
            Self::Name(names) => {
                let key = |line: &TableRow<'_>| {
                    let index = names.iter().position(|name| name == Some(line.field(column)));
                    index.map(|index| index as i32)
                };
                let keys = lines.iter().map(key).collect();
                Arc::new(
                    DictionaryArray::<Int32Type>::try_new(keys, Arc::clone(names) as ArrayRef)
                        .map_err(other)?,
                )
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use std::fs::{self, File};

    use arrow_array::cast::AsArray;
    use arrow_array::types::{Float64Type, UInt32Type, UInt64Type};
    use arrow_ipc::reader::FileReader;

    use super::*;
    use crate::run::Run;
    use crate::scenario::Scenario;

    const SCENARIO: &str = r#"
time-step = 0.001
steps = 200
[[species]]
name = "A"
diffusion = 100
[[species]]
name = "B"
diffusion = 50
[[transmitter]]
name = "near"
release = [{ species = "A", count = 300 }, { species = "B", count = 200 }]
times = [0, 0.05]
[[transmitter]]
name = "far"
center = [9, 0, 0]
release = [{ species = "B", count = 100 }]
[[receiver]]
name = "one"
center = [3, 0, 0]
radius = 1.5
kind = "absorbing"
[[receiver]]
name = "other"
center = [0, 4, 0]
radius = 1.5
kind = "absorbing"
[output]
arrivals = true
"#;

    fn run(directory: &Path, scenario: &str) -> Result<Model, Error> {
        let mut scenario = Scenario::parse(Path::new("arrow.toml"), scenario.to_owned())?;
        scenario.output.arrow = true;
        let model = scenario.model.clone();
        let run = Run { overwrite: true, space_check: false, ..Run::new(scenario, "arrow.toml", directory) };
        run.run(|_| std::ops::ControlFlow::Continue(())).map(|_| model)
    }

    fn rows(path: &Path) -> Vec<String> {
        let mut rows = Vec::new();
        for batch in FileReader::try_new(File::open(path).unwrap(), None).unwrap() {
            let batch = batch.unwrap();
            let field = |column: &ArrayRef, row: usize| match column.data_type() {
                _ if column.is_null(row) => String::new(),
                DataType::UInt32 => column.as_primitive::<UInt32Type>().value(row).to_string(),
                DataType::UInt64 => column.as_primitive::<UInt64Type>().value(row).to_string(),
                DataType::Float64 => column.as_primitive::<Float64Type>().value(row).to_string(),
                _ => {
                    let names = column.as_dictionary::<Int32Type>();
                    let key = names.keys().value(row) as usize;
                    names.values().as_string::<i32>().value(key).to_owned()
                }
            };
            rows.extend((0..batch.num_rows()).map(|row| {
                batch.columns().iter().map(|column| field(column, row)).collect::<Vec<_>>().join(",")
            }));
        }
        rows
    }

    #[test]
    fn arrow_files_have_every_row_of_the_tables() {
        let folder = tempfile::tempdir().unwrap();
        let model = run(folder.path(), SCENARIO).unwrap();
        let table = |name: &str| fs::read_to_string(folder.path().join(name)).unwrap();
        for name in FILE_NAMES {
            // Resumed runs find their copies by the mark, also in builds without Arrow.
            let bytes = fs::read(folder.path().join(name)).unwrap();
            assert!(bytes[..2048].windows(ARROW_MARK[1].len()).any(|part| part == ARROW_MARK[1].as_bytes()));
        }
        for (name, min_rows) in [("arrivals", 200), ("releases", 5)] {
            let expected = table(&format!("{name}.csv"));
            let found = rows(&folder.path().join(format!("{name}.arrow")));
            assert_eq!(found, expected.lines().skip(1).collect::<Vec<_>>(), "{name}");
            assert!(found.len() >= min_rows, "{} {name}", found.len());
        }
        let many: String = (0..BATCH_ROWS + 5).map(|k| format!("{k},0.5,one,B,{k},,\n")).collect();
        let header = table("arrivals.csv").lines().next().unwrap().to_owned();
        fs::write(folder.path().join("arrivals.csv"), format!("{header}\n{many}")).unwrap();
        convert(folder.path(), &model).unwrap();
        assert_eq!(rows(&folder.path().join("arrivals.arrow")), many.lines().collect::<Vec<_>>());
        fs::write(folder.path().join("arrivals.csv"), format!("{header}\n1,x,one,B,1,,\n")).unwrap();
        let error = convert(folder.path(), &model).unwrap_err().to_string();
        assert!(error.contains("'x' is not such a number"), "{error}");
        assert_eq!(rows(&folder.path().join("arrivals.arrow")).len(), BATCH_ROWS + 5);
    }

    #[test]
    fn a_scenario_without_a_log_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let error = run(folder.path(), &SCENARIO.replace("arrivals = true", "")).unwrap_err().to_string();
        assert!(error.contains("arrivals = true"), "{error}");
    }
}
