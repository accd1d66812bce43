use lazygrid::Config;
use lazygrid::gpu::SoftwareAdapter;
use lazygrid_ranks::Communicator;

use super::agree;
use super::cpu_run::{all_parents, all_requests};
use crate::gpu::{GpuOptions, GpuSimulation, ReceptorRequests};
use crate::motion::binding;
use crate::motion::request_counts::RequestCounts;
use crate::run::any::{GPU_STEPS, open_device};
use crate::state::RankStart;
use crate::{Error, Model};

#[derive(Debug)]
pub(super) struct GpuRun {
    pub(super) simulation: GpuSimulation,
    /// Requests of all ranks.
    pub(super) requests: RequestCounts,
}

impl GpuRun {
    pub(super) fn new(
        model: Model,
        detector: &Config,
        start: RankStart<'_>,
        ranks_on_machine: u32,
    ) -> Result<Self, Error> {
        let shared = || detector.shared_device(SoftwareAdapter::Allow);
        let state = start.state;
        let particles = (state.particles.len() + state.bound.len()) as u64;
        let device = open_device(particles, ranks_on_machine, shared)?;
        let options = GpuOptions::default();
        let simulation = GpuSimulation::resume_slice(model, device, options, start)?;
        Ok(Self { simulation, requests: RequestCounts::default() })
    }

    pub(super) fn steps_at_once(&self) -> u32 {
        if self.simulation.has_shared_steps() { 1 } else { GPU_STEPS }
    }

    pub(super) fn advance<C: Communicator>(
        &mut self,
        communicator: &mut C,
        max_steps: u32,
        occupied: &[u64],
    ) -> Result<(), C::Error> {
        if self.simulation.has_shared_steps() {
            return self.step(communicator, occupied);
        }
        agree(communicator, self.simulation.run(max_steps.min(GPU_STEPS)))
    }

    fn step<C: Communicator>(&mut self, communicator: &mut C, occupied: &[u64]) -> Result<(), C::Error> {
        let requests = agree(communicator, self.simulation.request_receptors(occupied))?;
        let accepted = self.accept(communicator, &requests, occupied)?;
        let step = agree(communicator, self.simulation.begin_shared_step(requests, &accepted))?;
        let parents = match self.simulation.assigns_ids() {
            true => all_parents(communicator, &step.parents)?,
            false => Vec::new(),
        };
        agree(communicator, self.simulation.conclude_shared_step(step, &parents))
    }

    fn accept<C: Communicator>(
        &mut self,
        communicator: &mut C,
        requests: &ReceptorRequests,
        occupied: &[u64],
    ) -> Result<Vec<u32>, C::Error> {
        let mut accepted = requests.counts();
        if accepted.is_empty() {
            return Ok(accepted);
        }
        let counts: Vec<u64> = accepted.iter().map(|&count| count.into()).collect();
        let all = communicator.all_reduce_sum(&counts);
        let free = binding::free_receptors(self.simulation.model(), occupied);
        let refused = all.iter().zip(&free).map(|(&all, &free)| [all, all.saturating_sub(free.into())]);
        let is_any_refused = refused.clone().any(|[_, refused]| refused > 0);
        if is_any_refused {
            // Reads the keys of all particles back, which is rare at a suitable time step.
            let own_requests = agree(communicator, self.simulation.requests_by_key(requests))?;
            let all = all_requests(communicator, &own_requests)?;
            let rejected = binding::rejected(all, &free);
            for request in own_requests.iter().filter(|request| rejected.binary_search(&request.id()).is_ok())
            {
                accepted[request.receptor()] -= 1;
            }
        }
        self.requests.add(refused);
        Ok(accepted)
    }
}
