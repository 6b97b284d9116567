/* Text: what a macro represents, and messages that quote a stranger. Pure. */
#ifndef PSABENCH_BASE_TEXT_H
#define PSABENCH_BASE_TEXT_H

/* The value of a macro in quotes. */
#define TEXT_OF_WORD(x) #x
#define TEXT_OF(macro)  TEXT_OF_WORD(macro)

/* A message is one line, whatever words are quoted in it: control characters become question marks. */
static inline void text_one_line(char *s)
{
    for (; *s; s++)
        if ((unsigned char)*s < ' ' || *s == 0x7F) *s = '?';
}

#endif
