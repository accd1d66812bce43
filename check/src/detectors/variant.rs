use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};

use lazygrid::gpu::{AdapterId, GpuConfig, GpuDevice, GpuSession};
use lazygrid::{Algorithm, Backend, Config, Detector, Order, Pair, Simd, Skin};

use crate::device::TIMEOUT;
use crate::scenes::motion::{skin_of, walk};
use crate::{Effort, TestInput, Tolerance};

#[derive(Clone, Debug)]
pub struct Gpu {
    pub device: GpuDevice,
    pub adapter: Option<AdapterId>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectorVariant {
    pub algorithm: Algorithm,
    pub target: TargetDevice,
    pub tau: Option<u32>,
    pub cell_ratio: Option<f32>,
    /// Fraction of a radius; 0 leaves the choice to the detector.
    pub skin: f32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TargetDevice {
    Cpu {
        simd: Simd,
        /// `None` for the global pool.
        threads: Option<usize>,
    },
    Gpu {
        subgroups: bool,
    },
}

impl DetectorVariant {
    pub fn new(algorithm: Algorithm, target: TargetDevice) -> Self {
        Self { algorithm, target, tau: None, cell_ratio: None, skin: 0.0 }
    }

    /// Returns all SIMD widths on one thread, and the widest on all threads.
    pub fn on_cpu() -> Vec<Self> {
        let widest = Simd::detect();
        let mut widths = vec![Simd::Avx512, Simd::Avx2, Simd::Portable];
        widths.drain(..widths.iter().position(|width| *width == widest).unwrap_or(0));
        let targets = widths.into_iter().map(|simd| TargetDevice::Cpu { simd, threads: Some(1) });
        let targets = targets.chain([TargetDevice::Cpu { simd: widest, threads: None }]);
        targets
            .flat_map(|target| Algorithm::CPU.iter().map(move |&algorithm| Self::new(algorithm, target)))
            .collect()
    }

    /// Returns each algorithm with and without subgroup operations and with τ = 1, and a cell list with
    /// candidates. A [quick](Effort::Quick) check has only default settings and the latter.
    pub fn on_gpu(gpu: &GpuDevice, effort: Effort) -> Vec<Self> {
        let with = |subgroups, tau| {
            let variant =
                move |algorithm| Self { tau, ..Self::new(algorithm, TargetDevice::Gpu { subgroups }) };
            Algorithm::GPU.iter().copied().map(variant).collect::<Vec<_>>()
        };
        let subgroups = gpu.adapter.has_subgroups;
        let keeping = Self { skin: 0.5, ..Self::new(Algorithm::CellList, TargetDevice::Gpu { subgroups }) };
        if effort == Effort::Quick {
            return [with(subgroups, None), vec![keeping]].concat();
        }
        let mut variants = with(false, None);
        if subgroups {
            variants.extend(with(true, None));
        }
        variants.extend(with(subgroups, Some(1)));
        variants.push(keeping);
        variants
    }

    pub fn backend(&self) -> Backend {
        match self.target {
            TargetDevice::Cpu { .. } => Backend::Cpu,
            TargetDevice::Gpu { .. } => Backend::Gpu,
        }
    }

    pub fn tolerance(&self) -> Tolerance {
        match self.target {
            TargetDevice::Cpu { .. } => Tolerance::Exact,
            TargetDevice::Gpu { .. } => Tolerance::Tangent,
        }
    }

    /// Returns the configuration of a `Detector`, which uses subgroup operations whenever the device has them.
    pub fn config(&self, gpu: Option<&Gpu>) -> Config {
        let mut config = Config::default().backend(self.backend()).algorithm(self.algorithm);
        if let Some(tau) = self.tau {
            config = config.tau(tau);
        }
        if let Some(ratio) = self.cell_ratio {
            config = config.cell_ratio(ratio);
        }
        match self.target {
            TargetDevice::Cpu { simd, threads } => {
                let config = config.simd(simd);
                threads.map_or(config.clone(), |threads| config.threads(threads))
            }
            TargetDevice::Gpu { .. } => {
                let config = config.timeout(TIMEOUT);
                match gpu.and_then(|gpu| gpu.adapter.clone()) {
                    Some(adapter) => config.adapter(adapter),
                    None => config,
                }
            }
        }
    }

    /// Uses a `Detector` in canonical order, or a session in any order.
    pub fn pairs(&self, gpu: Option<&Gpu>, scenario: &TestInput) -> Result<Vec<Pair>, String> {
        catch_panic(|| match (self.target, gpu) {
            (TargetDevice::Gpu { subgroups }, Some(gpu)) if !scenario.is_refined() => {
                self.pairs_in_session(gpu, subgroups, scenario)
            }
            _ => {
                let skin = skin_of(&scenario.spheres, self.skin);
                let config = self.config(gpu).skin(skin).order(Order::Canonical);
                let config = scenario.config(config).map_err(text)?;
                let mut detector = Detector::new(config).map_err(text)?;
                if self.skin > 0.0 {
                    detector.count(self.before(scenario).query()).map_err(text)?;
                }
                detector.pairs(scenario.query()).map_err(text)?;
                in_order(detector.into_pairs())
            }
        })
    }

    /// A filter on the host needs a [`Detector`](Self::config).
    pub fn takes(&self, gpu: Option<&Gpu>, scenario: &TestInput) -> bool {
        match (self.target, gpu) {
            (TargetDevice::Gpu { subgroups }, Some(gpu)) => {
                subgroups == gpu.device.adapter.has_subgroups || !scenario.is_refined()
            }
            _ => true,
        }
    }

    fn before(&self, scenario: &TestInput) -> TestInput {
        let mut before = scenario.clone();
        walk(&mut before.spheres, 0.1 * self.skin, 1);
        before
    }

    fn pairs_in_session(
        &self,
        gpu: &Gpu,
        subgroups: bool,
        scenario: &TestInput,
    ) -> Result<Vec<Pair>, String> {
        // Many scenes exceed this capacity and are retried.
        let settings = GpuConfig::default()
            .pair_capacity(1 << 12)
            .algorithm(self.algorithm)
            .subgroups(subgroups)
            .tau(self.tau.unwrap_or(GpuConfig::TAU))
            .cell_ratio(self.cell_ratio.unwrap_or(GpuConfig::CELL_RATIO).max(GpuConfig::MIN_CELL_RATIO))
            .interactions(scenario.interactions().map_err(text)?)
            .space(scenario.space);
        let mut session = GpuSession::new(gpu.device.clone(), settings).map_err(text)?;
        session.set_timeout(TIMEOUT);
        if let Skin::Fixed(distance) = skin_of(&scenario.spheres, self.skin) {
            session.set_skin(Some(distance as f32)).map_err(text)?;
            let ticket = session.begin(self.before(scenario).view()).map_err(text)?;
            session.finish_count(ticket).map_err(text)?;
        }
        let ticket = session.begin(scenario.view()).map_err(text)?;
        Ok(session.finish(ticket, u64::MAX).map_err(text)?.to_vec())
    }

    /// Returns the options of `lazygrid detect`; empty if it cannot repeat the variant.
    pub fn options(&self, gpu: Option<&Gpu>) -> String {
        let without_subgroups = match (self.target, gpu) {
            (TargetDevice::Gpu { subgroups }, Some(gpu)) => subgroups != gpu.device.adapter.has_subgroups,
            _ => false,
        };
        if self.skin > 0.0 || without_subgroups {
            return String::new();
        }
        let mut options = format!(" --backend {} --algorithm {}", self.backend(), self.algorithm);
        if let (TargetDevice::Gpu { .. }, Some(adapter)) =
            (self.target, gpu.and_then(|gpu| gpu.adapter.as_ref()))
        {
            options += &format!(" --adapter '{adapter}'");
        }
        if let TargetDevice::Cpu { threads: Some(threads), .. } = self.target {
            options += &format!(" --threads {threads}");
        }
        let tau = self.tau.map(|tau| format!(" --tau {tau}"));
        let ratio = self.cell_ratio.map(|ratio| format!(" --cell-ratio {ratio}"));
        options + &tau.unwrap_or_default() + &ratio.unwrap_or_default()
    }

    /// Returns the environment variable that selects the SIMD width.
    pub fn environment(&self) -> &'static str {
        match self.target {
            TargetDevice::Gpu { .. } => "",
            TargetDevice::Cpu { simd: Simd::Avx512, .. } => "LAZYGRID_SIMD=avx512 ",
            TargetDevice::Cpu { simd: Simd::Avx2, .. } => "LAZYGRID_SIMD=avx2 ",
            TargetDevice::Cpu { .. } => "LAZYGRID_SIMD=portable ",
        }
    }
}

impl fmt::Display for DetectorVariant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} on {}", self.algorithm, self.backend())?;
        match self.target {
            TargetDevice::Cpu { simd, threads: None } => write!(f, ", all threads, {simd:?}")?,
            TargetDevice::Cpu { simd, threads: Some(threads) } => write!(f, ", threads {threads}, {simd:?}")?,
            TargetDevice::Gpu { subgroups } => {
                write!(f, ", subgroups {}", if subgroups { "on" } else { "off" })?
            }
        }
        self.tau.map_or(Ok(()), |tau| write!(f, ", τ {tau}"))?;
        self.cell_ratio.map_or(Ok(()), |ratio| write!(f, ", cell ratio {ratio}"))?;
        if self.skin > 0.0 { write!(f, ", candidates kept") } else { Ok(()) }
    }
}

pub(crate) fn in_order(pairs: Vec<Pair>) -> Result<Vec<Pair>, String> {
    if pairs.is_sorted() { Ok(pairs) } else { Err("the pairs are not in canonical order".to_owned()) }
}

pub fn catch_panic<T>(work: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|payload| {
        let message = payload.downcast_ref::<String>().map(String::as_str);
        let message = message.or_else(|| payload.downcast_ref::<&str>().copied());
        Err(format!("panicked: {}", message.unwrap_or("no message")))
    })
}

pub(crate) fn text(error: impl fmt::Display) -> String {
    error.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_out_of_order_are_refused() {
        let pairs = |pairs: &[(u32, u32)]| pairs.iter().map(|&(i, j)| Pair { i, j }).collect::<Vec<_>>();
        assert_eq!(in_order(pairs(&[(0, 1), (0, 2), (1, 2)])), Ok(pairs(&[(0, 1), (0, 2), (1, 2)])));
        for wrong in [&[(0, 2), (0, 1)], &[(1, 2), (0, 1)]] {
            assert!(in_order(pairs(wrong)).is_err_and(|what| what.contains("canonical order")));
        }
    }

    #[test]
    fn options_name_all_that_detect_can_repeat() {
        let on = |target| DetectorVariant::new(Algorithm::CellList, target);
        let simd = Simd::detect();
        let one = on(TargetDevice::Cpu { simd, threads: Some(1) });
        assert_eq!(one.options(None), " --backend cpu --algorithm cell-list --threads 1");
        let expected = match simd {
            Simd::Avx512 => "LAZYGRID_SIMD=avx512 ",
            Simd::Avx2 => "LAZYGRID_SIMD=avx2 ",
            _ => "LAZYGRID_SIMD=portable ",
        };
        assert_eq!(one.environment(), expected);
        let gpu = on(TargetDevice::Gpu { subgroups: false });
        assert_eq!(
            (gpu.environment(), gpu.options(None)),
            ("", " --backend gpu --algorithm cell-list".to_owned())
        );
        assert_eq!(DetectorVariant { skin: 0.5, ..gpu }.options(None), "");
    }
}
