//! What a detector with a skin does from call to call: serve it from candidates, find new ones, or search without.

use super::motion::Motion;
use super::worth::{Choice, allowances, choose};
use super::{Allowances, Candidates, fixed};
use crate::cell_list::{CellList, Crowding, Outlook};
use crate::compare::Rule;
use crate::input::Input;
use crate::report::{Rebuilt, Report};
use crate::threads::Threads;
use crate::{Error, Skin};

/// Calls at most for which a choice is not thought over, and after candidates that were too many.
const PATIENCE: u32 = 31;

/// Candidates, and what decides on the next.
#[derive(Debug, Default)]
pub(crate) struct Course {
    pub(crate) candidates: Candidates,
    motion: Motion,
    outlook: Option<Outlook>,
    choice: Option<Choice>,
    /// How far the farthest sphere had gone one call after the candidates were found, as a part of its allowance.
    first: f32,
    /// For how many searches the choice stands, and for how many it stood the last time.
    wait: u32,
    patience: u32,
    /// For how many searches no candidates are looked for, as they were too many.
    pause: u32,
}

impl Course {
    /// Takes up where the spheres are now. Says why candidates cannot serve the call, if they cannot.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(crate) fn advance(
        &mut self,
        skin: Skin,
        (rule, list): (&Rule<'_>, &CellList),
        threads: Threads,
    ) -> Result<Option<Rebuilt>, Error> {
        if skin == Skin::Auto {
            self.motion.observe(rule)?;
        }
        let lapsed = self.candidates.refresh(rule, list, threads);
        let (age, moved) = self.candidates.age();
        if age == 1 {
            self.first = moved;
        }
        if lapsed == Some(Rebuilt::Moved)
            && let Some(choice) = &self.choice
        {
            self.motion.learn(self.first * choice.skin, (age, moved * choice.skin));
            // What lasted about as long as expected need not be thought over soon.
            let as_expected = (0.5..=2.0).contains(&(age as f32 / (choice.calls + 1.0)));
            self.wait = if as_expected { self.wait } else { 0 };
        }
        Ok(lapsed)
    }

    /// Finds candidates where they are worth it, else only builds the list. Whether there are candidates now.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(crate) fn find(
        &mut self,
        list: &mut CellList,
        input: &Input<'_>,
        report: &mut Report,
    ) -> Result<bool, Error> {
        let last = self.outlook.take();
        let outlook = report.time("plan", || Outlook::of(last, input))?;
        let crowding = outlook.crowding();
        let allowances = match input.settings.skin {
            // Only one set has candidates.
            _ if input.split.is_some() => None,
            Skin::Off => None,
            _ if self.pause > 0 => {
                self.pause -= 1;
                None
            }
            Skin::Fixed(distance) => Some(fixed(input.rule.searched(distance))),
            Skin::Auto => report.time("plan", || self.choose(input, crowding)),
        };
        if let Some(allowances) = allowances {
            if self.candidates.find((list, crowding), input, &allowances, report)? {
                self.outlook = Some(outlook);
                return Ok(true);
            }
            self.pause = PATIENCE;
        }
        // Candidates go by where the list has the spheres.
        self.candidates.clear();
        list.build(input, crowding, report)?;
        self.outlook = Some(outlook);
        Ok(false)
    }

    /// The allowances that are worth it.
    fn choose(&mut self, input: &Input<'_>, crowding: &Crowding) -> Option<Allowances> {
        let (steps, growth) = self.motion.steps()?;
        if self.wait > 0 {
            self.wait -= 1;
        } else {
            let choice = choose(&input.survey, crowding, (&steps, growth));
            let skin = |choice: Option<Choice>| choice.map(|choice| choice.skin);
            let same = skin(choice) == skin(self.choice);
            self.patience = if same { (2 * self.patience + 1).min(PATIENCE) } else { 0 };
            (self.wait, self.choice) = (self.patience, choice);
        }
        self.choice.map(|choice| allowances(&steps, choice.skin))
    }
}
