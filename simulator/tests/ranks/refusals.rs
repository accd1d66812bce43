use lazygrid_sim::ranks::RankSimulation;
use lazygrid_sim::{Flow, Model};

use crate::models::{everything, model};
use crate::{on_cpu, threads};

fn errors(model: &Model, steps: u32) -> Vec<String> {
    threads::on(3, |thread| {
        let mut run = RankSimulation::new(thread, model.clone(), 1, on_cpu())?;
        (0..steps).try_for_each(|_| run.step())
    })
    .into_iter()
    .map(|ended| ended.unwrap_err())
    .collect()
}

#[test]
fn failure_of_one_rank_is_returned_on_all() {
    let mut model =
        Model { flow: Some(Flow::Plug([1e38, 0.0, 0.0])), time_step: 1e3, ..model(&everything()) };
    model.boundary.axes = [lazygrid_sim::Axis::Open; 3];
    let messages = errors(&model, 5);
    assert!(messages[0].starts_with("rank ") && messages[0].contains(": step "), "{messages:?}");
    assert_eq!(messages, vec![messages[0].clone(); 3]);
}
