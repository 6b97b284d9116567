/* Output files: one writing process, and cutting to whole lines after a write error.
 *
 * The lock is flock's (advisory): the kernel drops it when the process ends, however it ends, and the Python writers take
 * the same lock (psabench/link/own.py). Only regular files are locked, not devices and pipes. */
#ifndef PSABENCH_LINK_OWN_FILE_H
#define PSABENCH_LINK_OWN_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <sys/types.h>

/* Opens for reading and writing, close-on-exec; an earlier file is emptied once it is ours. The descriptor, or -errno:
 * -EBUSY another process writes it, *owner is its pid (0: not known). */
int own_file_open(const char *path, long *owner);

/* True when the path leads to another file or to none: what is written from now on cannot be found. */
bool own_file_gone(int fd, const char *path);

/* Cuts a file of lines behind its last whole one; returns the bytes it has then, 0 if it cannot be read. */
off_t own_file_cut(int fd);

/* True when the file has no name any more; else it was moved, and what is in it can be found. */
bool own_file_removed(int fd);

/* A pseudo-terminal is locked by fcntl's lock on /dev/ptmx, the byte of its number, which shows who serves it. It ends with
 * the first master that this process closes. path: /dev/pts/N of the master. */
void own_port_lock(int master, const char *path);

/* Process that serves /dev/pts/N; 0: none, or in another PID namespace. Does not open it: its owner would see that. */
long own_port_owner(const char *path);

/* An unbuffered stream, so that fclose() does not write again what a full disk did not take. NULL with one line in why,
 * which begins with `where` ("--vcd "), and *user: the fault lies with the path that was given. */
FILE *own_file_output(const char *where, const char *path, bool *user, char *why, size_t cap);

/* The line and *user for -errno of own_file_open(). False. */
bool own_file_fail(const char *where, const char *path, int err, long owner, bool *user, char *why, size_t cap);

/* Text of an error of a file; ESTALE: moved, removed or replaced while it was written. Until the next call. */
const char *own_file_strerror(int error);

#endif
