/* Neighbor lists with geometry. C99. */
#include "checks.h"

/* One atom of a cubic crystal: its neighbors are its own images. */
static void lists_have_all_images(void) {
    static const double origin[] = {0.5, 0.5, 0.5}, half_cutoff = 1.5;
    const uint32_t all = LAZYGRID_LIST_SHIFTS | LAZYGRID_LIST_VECTORS | LAZYGRID_LIST_DISTANCES;
    lazygrid_spheres atom = lazygrid_points_f64(1, origin, &half_cutoff);
    lazygrid_settings settings = on_cpu();
    lazygrid_query query = lazygrid_among(&atom);
    lazygrid_detector *detector;
    lazygrid_list list;
    uint64_t k;
    settings.periodic[0] = settings.periodic[1] = settings.periodic[2] = 2.5;
    detector = detector_of(&settings);
    CHECK(lazygrid_neighbor_list(detector, &query, all, &list) == LAZYGRID_OK && list.length == 6);
    CHECK(list.offsets[0] == 0 && list.offsets[1] == 6);
    for (k = 0; k < list.length; k++) {
        int axis;
        CHECK(list.pairs[k].i == 0 && list.pairs[k].j == 0 && list.distances[k] == 2.5);
        for (axis = 0; axis < 3; axis++) CHECK(list.vectors[k][axis] == 2.5 * list.shifts[k][axis]);
    }
    CHECK(list.shifts[0][0] == -1 && list.shifts[5][0] == 1);
    CHECK(lazygrid_neighbor_list(detector, &query, LAZYGRID_LIST_HALF, &list) == LAZYGRID_OK && list.length == 3);
    CHECK(list.shifts == NULL && list.vectors == NULL && list.distances == NULL && list.pairs != NULL);
    CHECK(lazygrid_neighbor_list(detector, &query, LAZYGRID_LIST_SELF, &list) == LAZYGRID_OK && list.length == 7);
    CHECK(lazygrid_neighbor_list(detector, &query, 64, &list) == LAZYGRID_ERROR_ARGUMENT && list.length == 0);
    CHECK(says(lazygrid_last_error(detector), "LAZYGRID_LIST_"));
    CHECK(lazygrid_neighbor_list(detector, &query, 0, NULL) == LAZYGRID_ERROR_ARGUMENT);
    lazygrid_destroy(detector);
    settings.periodic[0] = 3;
    detector = detector_of(&settings);
    CHECK(lazygrid_neighbor_list(detector, &query, 0, &list) == LAZYGRID_OK && list.length == 6);
    CHECK(lazygrid_neighbor_list(detector, &query, LAZYGRID_LIST_OPEN, &list) == LAZYGRID_OK && list.length == 4);
    lazygrid_destroy(detector);
}

int main(void) {
    lists_have_all_images();
    printf("%d passed, %d failed\n", passed, failed);
    return failed != 0;
}
