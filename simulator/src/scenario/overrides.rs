use std::num::NonZeroU32;

use super::Scenario;
use crate::output::animation::Animation;

/// Approximate number.
const ANIMATION_FRAMES: u32 = 200;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Overrides {
    pub seed: Option<u64>,
    pub steps: Option<u32>,
    /// Steps between rows of the series.
    pub every: Option<NonZeroU32>,
    pub frames_every: Option<NonZeroU32>,
    pub checkpoint_every: Option<NonZeroU32>,
    /// Limit of drawn particles; `None` for no animation.
    pub animated: Option<NonZeroU32>,
    /// Steps between frames; by default a two-hundredth of the scenario's.
    pub animate_every: Option<NonZeroU32>,
}

impl Scenario {
    pub fn change(&mut self, changes: &Overrides) {
        let animation = |particles| Animation {
            // The scenario's steps, so that an extended run has the same interval.
            every: changes.animate_every.map_or((self.steps / ANIMATION_FRAMES).max(1), Into::into),
            particles,
        };
        self.output.animation = changes.animated.map(animation);
        self.seed = changes.seed.unwrap_or(self.seed);
        self.steps = changes.steps.unwrap_or(self.steps);
        let output = &mut self.output;
        output.every = changes.every.map_or(output.every, Into::into);
        output.frames_every = changes.frames_every.map_or(output.frames_every, Into::into);
        output.checkpoint_every = changes.checkpoint_every.map(Into::into).or(output.checkpoint_every);
    }
}
