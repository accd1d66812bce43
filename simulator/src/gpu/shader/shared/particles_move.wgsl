#include control
#include params
#include philox
#include normal
#include unit_32
#include tag
#include velocity
#include boundary
#include event

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> trajectory: TrajectoryHeader;
@group(0) @binding(2) var<storage, read_write> control: Control;
@group(0) @binding(3) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> tags: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read_write> moved: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> species: array<u32>;
@group(0) @binding(7) var<storage, read> species_rows: array<SpeciesRow>;
@group(0) @binding(8) var<storage, read> event_rows: array<EventRow>;
@group(0) @binding(9) var<storage, read> scene_rows: array<vec4<u32>>;

#include velocity_index
#include receiver_cells
#include first_passage
#include wall
#include hit
#include path_hit
#ifdef WITHOUT_MEMBRANES
#include no_membranes
#else
#include membranes
#endif
#include collided
#include decay
#include absorbing_wall

fn mark(at: u32, tag: vec2<u32>, is_spared: bool) {
    let marked = select(species_of(tag), species_of(tag) | SPARED, is_spared);
    if (marked != tag.x) {
        tags[at] = vec2(marked, tag.y);
    }
}
