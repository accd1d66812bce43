/* Counted checks, and detectors to check. */
#ifndef CHECKS_H
#define CHECKS_H

#include <lazygrid.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int passed, failed;

#define CHECK(condition)                                                          \
    do {                                                                          \
        if (condition) {                                                          \
            passed++;                                                             \
        } else {                                                                  \
            failed++;                                                             \
            fprintf(stderr, "%s:%d: not so: %s\n", __FILE__, __LINE__, #condition); \
        }                                                                         \
    } while (0)

/* Returns 1 if a message contains a text; otherwise shows the message. */
static inline int says(const char *message, const char *text) {
    int found = strstr(message, text) != NULL;
    if (!found) fprintf(stderr, "the message is: %s\n", message);
    return found;
}

static inline lazygrid_settings on_cpu(void) {
    lazygrid_settings settings;
    CHECK(lazygrid_settings_init(&settings, sizeof settings) == LAZYGRID_OK);
    settings.backend = LAZYGRID_BACKEND_CPU;
    return settings;
}

static inline lazygrid_detector *detector_of(const lazygrid_settings *settings) {
    lazygrid_detector *detector = NULL;
    if (lazygrid_create(settings, &detector) != LAZYGRID_OK) {
        fprintf(stderr, "no detector: %s\n", lazygrid_last_error(NULL));
        exit(1);
    }
    return detector;
}

#endif
