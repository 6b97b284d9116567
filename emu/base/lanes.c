#include "base/lanes.h"

bool lanes_allowed(void)
{
    return true;
}
