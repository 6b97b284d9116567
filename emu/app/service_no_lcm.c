/* In place of service_lcm.c where lcm-gen was not there when the emulator was built (tools/gen_lcm). */
#include "app/service.h"
#include "base/why.h"

bool service_open_lcm(struct service *s, char *why, size_t cap)
{
    if (!s->o->lcm) return true;
    return why_fail(why, cap,
                    "--lcm: expected an emulator built with LCM (Debian: liblcm-bin, liblcm-dev), got one without");
}

void service_end_lcm(struct service *s)
{
    (void)s;
}

void service_describe_lcm(const struct service *s, cJSON *files)
{
    (void)s;
    (void)files;
}

void service_print_lcm(const struct service *s)
{
    (void)s;
}

void service_close_lcm(struct service *s)
{
    (void)s;
}
