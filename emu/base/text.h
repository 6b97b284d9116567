/* Text that quotes what a stranger wrote. Pure. */
#ifndef PSABENCH_BASE_TEXT_H
#define PSABENCH_BASE_TEXT_H

/* A message is one line, whatever words are quoted in it: control characters become question marks. */
static inline void text_one_line(char *s)
{
    for (; *s; s++)
        if ((unsigned char)*s < ' ' || *s == 0x7F) *s = '?';
}

#endif
