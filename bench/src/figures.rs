//! The paper's evaluation.

mod burst;
pub mod compare;
mod comparison;
mod contender;
mod environment;
mod figure;
mod fit;
mod memory;
mod plan;
mod report;
mod row;
mod run;
mod verify;

pub use contender::Contender;
pub use environment::{Adapter, Environment};
pub use figure::Figure;
pub use memory::{Sample, measure as measure_memory};
pub use plan::{RunScale, Settings};
pub use report::write as write_report;
pub use row::{Results, Row, Status};
pub use run::{Progress, run};
