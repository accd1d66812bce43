//! Decides what a detector with a skin does in a call: test the candidates, rebuild them, or search without any.

use super::worth::{Costs, Spread, choose};
use super::{Allowances, Candidates, Forecast, fixed};
use crate::cell_list::{CellList, Crowding, Outlook};
use crate::compare::Rule;
use crate::input::Input;
use crate::report::{Rebuilt, Report};
use crate::threads::Threads;
use crate::{Error, Skin};

/// Candidates, and what decides on the next.
#[derive(Debug, Default)]
pub(crate) struct Course {
    pub(crate) candidates: Candidates,
    forecast: Forecast,
    outlook: Option<Outlook>,
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
            self.forecast.observe(rule)?;
        }
        let lapsed = self.candidates.refresh(rule, list, threads);
        self.forecast.note_age(self.candidates.age(), lapsed);
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
        let outlook = report.time("plan", || list.outlook(last, input))?;
        let crowding = outlook.crowding();
        let allowances = match input.settings.skin {
            // Only one set has candidates.
            _ if input.split.is_some() => None,
            Skin::Off => None,
            Skin::Fixed(_) if self.forecast.is_paused() => None,
            Skin::Fixed(distance) => Some(fixed(input.rule.searched(distance))),
            Skin::Auto => report.time("plan", || self.choose(input, crowding))?,
        };
        if let Some(allowances) = allowances {
            if self.candidates.find((list, &outlook), input, &allowances, report)? {
                let count = self.candidates.kept(None).count;
                self.forecast.note_found(count as f32 / input.survey.spheres as f32);
                self.outlook = Some(outlook);
                return Ok(true);
            }
            self.forecast.note_too_many();
        }
        // Candidates go by where the list has the spheres.
        self.candidates.clear();
        list.build(input, &outlook, report)?;
        self.outlook = Some(outlook);
        Ok(false)
    }

    /// The allowances that are worth it.
    fn choose(&mut self, input: &Input<'_>, crowding: &Crowding) -> Result<Option<Allowances>, Error> {
        self.forecast.allowances(Spread::BySize, |motion, excess| {
            Ok(choose((&input.survey, crowding), motion, (&Costs::CPU, Spread::BySize), excess))
        })
    }
}
