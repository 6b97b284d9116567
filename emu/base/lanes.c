#include "base/lanes.h"

bool lanes_plain;
