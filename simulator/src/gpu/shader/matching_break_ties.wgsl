// Breaks ties between equal priorities by ids.
#include matching_stage break_ties
