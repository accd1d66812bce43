use super::layout::ChemotaxisRow;
use crate::model::Model;
use crate::model::chemotaxis::{Attractant, AttractantProfile, Chemotaxis};

impl ChemotaxisRow {
    const LINEAR: u32 = 1;
    const GAUSSIAN: u32 = 2;
    const SOURCE: u32 = 3;

    /// Scales concentrations by 1/K or |χ|, so that `f32` has them in any unit.
    pub(super) fn new(model: &Model, species: usize, probability: f64) -> Self {
        let Some(taxis) = model.species[species].chemotaxis else { return Self::default() };
        let Chemotaxis { attractant, sensitivity, half_saturation } = taxis;
        let (scale, sensitivity) = match half_saturation {
            Some(k) => (1.0 / k, sensitivity),
            None => (sensitivity.abs(), 1_f64.copysign(sensitivity)),
        };
        let Attractant { center, profile, .. } = model.attractants[attractant as usize];
        let (profile, level, size, gradient) = match profile {
            AttractantProfile::Linear { level, gradient } => (Self::LINEAR, level, 1.0, gradient),
            AttractantProfile::Gaussian { peak, width } => (Self::GAUSSIAN, peak, width, [0.0; 3]),
            AttractantProfile::Source { peak, radius } => (Self::SOURCE, peak, radius, [0.0; 3]),
        };
        Self {
            center: center.into(),
            profile,
            gradient: gradient.map(|g| (scale * g) as f32).into(),
            level: (scale * level) as f32,
            size: size as f32,
            sensitivity: sensitivity as f32,
            saturates: half_saturation.is_some().into(),
            probability: probability as f32,
        }
    }
}
