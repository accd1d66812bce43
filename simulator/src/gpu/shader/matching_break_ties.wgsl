// Breaks ties between equal priorities by the particles' ids.
#include matching_stage break_ties
