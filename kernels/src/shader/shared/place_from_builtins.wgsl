#ifdef SUBGROUPS
    let place = Place(local_index, subgroup_index, subgroup_count, subgroup_lane, subgroup_width);
#else
    let place = Place(local_index);
#endif
