use bytemuck::{Pod, Zeroable};

use super::WORKGROUP_SIZE;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
#[non_exhaustive]
pub struct SubgroupProbe {
    /// Bits [`Self::PARTIAL`], [`Self::OUT_OF_ORDER`] and [`Self::NO_SUBGROUPS`].
    pub faults: u32,
    pub invocations: u32,
    pub smallest: u32,
    pub largest: u32,
}

impl SubgroupProbe {
    /// Some subgroup is not full.
    pub const PARTIAL: u32 = 1;
    /// Lanes do not follow local indices.
    pub const OUT_OF_ORDER: u32 = 2;
    /// The probe was compiled without subgroup operations.
    pub const NO_SUBGROUPS: u32 = 4;
    pub const WORKGROUPS: u32 = 64;
    /// Initial content of the buffer.
    pub const BEFORE: Self = Self { faults: 0, invocations: 0, smallest: u32::MAX, largest: 0 };

    /// Returns the reason to avoid subgroup operations of at least `smallest` lanes, if any.
    pub fn refusal(&self, smallest: u32) -> Option<&'static str> {
        if self.invocations != Self::WORKGROUPS * WORKGROUP_SIZE || self.smallest > self.largest {
            return Some("the probe of subgroups did not run as dispatched");
        }
        if self.faults & Self::PARTIAL != 0 {
            return Some("subgroups are not full");
        }
        if self.faults & Self::OUT_OF_ORDER != 0 {
            return Some("lanes of subgroups do not follow local indices");
        }
        if self.faults != 0 || self.smallest < smallest {
            return Some("subgroups are smaller than the adapter reports");
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probe_refuses_each_violated_assumption() {
        let invocations = SubgroupProbe::WORKGROUPS * WORKGROUP_SIZE;
        let good = SubgroupProbe { faults: 0, invocations, smallest: 8, largest: 32 };
        assert_eq!((good.refusal(8), good.refusal(4)), (None, None));
        let wrong = [
            SubgroupProbe { faults: SubgroupProbe::PARTIAL, ..good },
            SubgroupProbe { faults: SubgroupProbe::OUT_OF_ORDER, ..good },
            SubgroupProbe { faults: SubgroupProbe::NO_SUBGROUPS, ..good },
            SubgroupProbe { invocations: invocations - 1, ..good },
            SubgroupProbe { smallest: 4, ..good },
            SubgroupProbe { invocations, ..SubgroupProbe::BEFORE },
            SubgroupProbe::BEFORE,
        ];
        for probe in wrong {
            assert!(probe.refusal(8).is_some(), "{probe:?}");
        }
    }
}
