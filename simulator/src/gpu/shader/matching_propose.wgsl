#include matching_stage propose
