/* Where the protocol files are: beside the working directory, the program, or installed. */
#ifndef PSABENCH_SCENARIO_FIND_H
#define PSABENCH_SCENARIO_FIND_H

#include <stdbool.h>
#include <stddef.h>

#define FIND_PATH_MAX 512u
#define FIND_NAME_MAX 64u

/* Path of proto/FOLDER/NAME.yaml, or NAME itself when it is a path (a '/' in it, or .yaml at its end; a relative one is
 * taken from the folder of the file `beside` when that is not NULL). Looked for in $PSABENCH_PROTO, ./proto, and
 * ../proto and ../share/psabench/proto of the program. False with one line in why, which tells the names that there are. */
bool find_proto(const char *folder, const char *name, const char *beside, char *path, char *why, size_t cap);

/* The names in a folder of protocol files, sorted; *names is the caller's to free(). False with one
 * line in why. */
bool find_names(const char *path, char (**names)[FIND_NAME_MAX], unsigned *count, char *why, size_t cap);

/* The folder proto/FOLDER itself. */
bool find_proto_folder(const char *folder, char *path, char *why, size_t cap);

#endif
