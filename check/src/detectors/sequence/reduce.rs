use super::request::Layout;
use super::{Sequence, Step, Wrong};
use crate::{TestInput, shrink};

pub(super) fn reduce(
    sequence: Sequence,
    wrong: Wrong,
    tries: usize,
    run: impl Fn(&Sequence) -> Result<(), Wrong>,
) -> (Sequence, Wrong) {
    let mut best = Best { sequence, wrong, left: tries, run };
    best.cut();
    for k in (0..best.sequence.steps.len()).rev() {
        let mut fewer = best.sequence.clone();
        if k < fewer.steps.len() && fewer.steps.len() > 1 {
            fewer.steps.remove(k);
            best.attempt(fewer);
        }
    }
    best.attempt_each(|step| {
        step.scenario.groups = None;
        step.scenario.excluded = None;
    });
    best.attempt_each(|step| step.request.layout = Layout::Rows);
    best.drop_spheres();
    best.shrink_last();
    (best.sequence, best.wrong)
}

struct Best<R> {
    sequence: Sequence,
    wrong: Wrong,
    left: usize,
    run: R,
}

impl<R: Fn(&Sequence) -> Result<(), Wrong>> Best<R> {
    fn cut(&mut self) {
        self.sequence.steps.truncate(self.wrong.0 + 1);
    }

    fn attempt(&mut self, smaller: Sequence) -> bool {
        if self.left == 0 {
            return false;
        }
        self.left -= 1;
        let Err(wrong) = (self.run)(&smaller) else { return false };
        (self.sequence, self.wrong) = (smaller, wrong);
        self.cut();
        true
    }

    fn attempt_each(&mut self, change: impl Fn(&mut Step)) {
        let mut smaller = self.sequence.clone();
        smaller.steps.iter_mut().for_each(change);
        self.attempt(smaller);
    }

    fn drop_spheres(&mut self) {
        let most = |sequence: &Sequence| sequence.steps.iter().map(|step| step.scenario.spheres.len()).max();
        let mut group = most(&self.sequence).unwrap_or(0).div_ceil(2);
        while group > 0 {
            let mut from = 0;
            while from < most(&self.sequence).unwrap_or(0) && self.left > 0 {
                let removed = from..from + group;
                let mut smaller = self.sequence.clone();
                for Step { scenario, request, .. } in &mut smaller.steps {
                    *scenario = scenario.only(|k| !removed.contains(&k));
                    request.split = request
                        .split
                        .map(|split| split - split.min(removed.end).saturating_sub(removed.start));
                }
                if !self.attempt(smaller) {
                    from += group;
                }
            }
            group /= 2;
        }
    }

    fn shrink_last(&mut self) {
        let last = self.sequence.steps.len() - 1;
        let mut smaller = self.sequence.clone();
        let failing = |scenario: &TestInput| {
            smaller.steps[last].scenario = scenario.clone();
            (self.run)(&smaller).err().filter(|(at, _)| *at == last).map(|(_, what)| what)
        };
        let scenario = self.sequence.steps[last].scenario.clone();
        let (scenario, what) = shrink(scenario, self.wrong.1.clone(), self.left, failing);
        self.sequence.steps[last].scenario = scenario;
        self.wrong = (last, what);
    }
}
