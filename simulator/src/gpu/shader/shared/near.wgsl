#include window
#include mover

// NextEvent by words; counts grow while lists are made.
struct Lists {
    words: array<atomic<u32>, 7>,
}
