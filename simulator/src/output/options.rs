use super::animation::Animation;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Output {
    /// Steps between rows of the series.
    pub every: u32,
    pub frames_every: u32,
    pub xyz: bool,
    pub npy: bool,
    /// Besides the last step.
    pub checkpoint_every: Option<u32>,
    /// Also writes the log as Arrow files; needs the feature `arrow`.
    pub arrow: bool,
    pub animation: Option<Animation>,
}

impl Output {
    pub fn has_frame(&self, step: u32) -> bool {
        (self.xyz || self.npy) && step.is_multiple_of(self.frames_every)
    }

    /// Returns the options if a frame follows this step.
    pub fn animated(&self, step: u32) -> Option<Animation> {
        self.animation.filter(|animation| step.is_multiple_of(animation.every))
    }
}
