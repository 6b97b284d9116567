/* --until-eof: the emulator ends when its standard input does. A program that starts one keeps the other end of the pipe:
 * however the program ends, killed or crashed, no emulator is left behind. */
#ifndef PSABENCH_APP_UNTIL_EOF_H
#define PSABENCH_APP_UNTIL_EOF_H

#include "link/link.h"

/* *quit becomes true at the end of standard input; what comes before it is passed over. */
void until_eof(struct link *l, struct links *ls, bool *quit);

#endif
