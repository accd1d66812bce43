macro_rules! includes {
    ($($name:ident)*) => {
        [$((stringify!($name), include_str!(concat!("../shader/shared/", stringify!($name), ".wgsl")))),*]
    };
}

pub(super) const INCLUDES: [(&str, &str); 47] = includes! {
    candidates cell_assignment cell_list cell_list_levels cell_list_reuse cell_list_search cell_list_setup
    cell_numbers cells digit_pass dispatch_2d displacement effective_radius entry evaluation_order
    far_tiles float_order inflated_radius key_hash layout neighbor_cells occupancy occupancy_add
    occupancy_slot outcome_begin outcome_clear overlap pairs periods reserve reserve_by_subgroup
    reused_cell runs_search side skin sphere stats store_sorted subgroup_max thread thread_builtins
    thread_from_builtins tile u64 workgroup_scan wrap wrapped_sphere
};
