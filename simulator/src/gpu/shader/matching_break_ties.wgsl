#include matching_stage break_ties
