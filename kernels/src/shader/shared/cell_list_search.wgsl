// The argument is the access to deferred blocks.
#include layout
#include cell_list
#include thread
#include sphere

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read> cell_list: CellListLayout;
@group(0) @binding(2) var<storage, read> starts: array<u32>;
@group(0) @binding(3) var<storage, read> sorted: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> cells: array<u32>;
@group(0) @binding(5) var<storage, read> order: array<u32>;
@group(0) @binding(6) var<storage, read_write> outcome: Outcome;
@group(0) @binding(7) var<storage, read_write> pairs: array<vec2<u32>>;
@group(0) @binding(8) var<storage, #{ARGUMENT}> deferred: array<u32>;
#ifdef SPECIES
@group(0) @binding(9) var<storage, read> sorted_species: array<u32>;
@group(0) @binding(10) var<storage, read> table: array<f32>;
#endif
#include overlap
#include pairs
#include dispatch_2d
#include cell_numbers
#include neighbor_cells
#include candidates
