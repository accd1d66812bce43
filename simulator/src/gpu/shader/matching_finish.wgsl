// Runs the remaining rounds in one workgroup, which can synchronize. If its loops would be too long, the run halts, and
// the host adds rounds before.
#include control
#include params
#include philox
#include normal
#include velocity
#include boundary
#include candidate
#include round

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> round: Round;
@group(0) @binding(2) var<storage, read_write> control: Control;
@group(0) @binding(3) var<storage, read> candidates: array<Candidate>;
@group(0) @binding(4) var<storage, read> reaction_rows: array<ReactionRow>;
@group(0) @binding(5) var<storage, read_write> claims: array<Claim>;
@group(0) @binding(6) var<storage, read> left: array<u32>;
@group(0) @binding(7) var<storage, read_write> moved: array<vec4<f32>>;

#include claims
#include apply_reaction

// Per candidate and round: four visits, one with a draw of ten rounds.
const ITERATIONS_PER_CANDIDATE: u32 = 32u;

// Free candidates. One entry is cleared while threads read the other.
var<workgroup> free: array<atomic<u32>, 2>;
var<workgroup> candidate_count: u32;

fn is_free_at(index: u32) -> bool {
    return is_free(candidates[index], reaction_rows[candidates[index].rule]);
}

fn synchronize() {
    storageBarrier();
    workgroupBarrier();
}

@compute @workgroup_size(256)
fn matching_finish(@builtin(local_invocation_index) local_index: u32) {
    if (local_index == 0u) {
        candidate_count = atomicLoad(&control.left[round.source]);
    }
    let count = workgroupUniformLoad(&candidate_count);
    let chunks = count / WORKGROUP_SIZE + 1u;
    let rounds = params.max_iterations / (ITERATIONS_PER_CANDIDATE * chunks);
    if (local_index < 2u) {
        atomicStore(&free[local_index], 0u);
    }
    synchronize();
    for (var number = 0u; number < rounds; number++) {
        for (var chunk = 0u; chunk < chunks; chunk++) {
            let k = chunk * WORKGROUP_SIZE + local_index;
            if (k < count && is_free_at(left[k])) {
                clear(left[k]);
                atomicAdd(&free[number & 1u], 1u);
            }
        }
        synchronize();
        if (workgroupUniformLoad(&free[number & 1u]) == 0u) {
            return;
        }
        for (var chunk = 0u; chunk < chunks; chunk++) {
            let k = chunk * WORKGROUP_SIZE + local_index;
            if (k < count && is_free_at(left[k])) {
                propose(left[k]);
            }
        }
        if (local_index == 0u) {
            atomicStore(&free[(number + 1u) & 1u], 0u);
        }
        synchronize();
        for (var chunk = 0u; chunk < chunks; chunk++) {
            let k = chunk * WORKGROUP_SIZE + local_index;
            if (k < count && is_free_at(left[k])) {
                break_ties(left[k]);
            }
        }
        synchronize();
        for (var chunk = 0u; chunk < chunks; chunk++) {
            let k = chunk * WORKGROUP_SIZE + local_index;
            if (k < count && is_free_at(left[k])) {
                apply_if_best(left[k]);
            }
        }
        synchronize();
    }
    if (local_index == 0u) {
        atomicOr(&control.halted, ROUNDS_LEFT);
    }
}
