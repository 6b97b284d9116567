// Lets the user-mode kernel run on CPUs whose register state is larger than it knows (AMX: 11008 bytes; Linux 6.1 for UML has 2696).
//
// UML switches the guest's vector registers with PTRACE_GETREGSET/SETREGSET. A host kernel hands out the first part of its state for
// a buffer that is too small, but refuses to set less than the whole: the guest's first process then dies of SIGSEGV. This library,
// preloaded into linux.uml by tests/uml/run, completes what is to be set from the process's present state. What lies past UML's part
// is AMX tiles, which no guest process can have. Later kernels size the buffer themselves, and then every call passes through as is.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <elf.h>
#include <stdarg.h>
#include <stdint.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/uio.h>

#define XSTATE_MAX       (1 << 16) // no CPU has that much
#define XSTATE_BV        512 // Intel SDM vol. 1, 13.4.2: which components the image holds, first word of the XSAVE header
#define XSTATE_BV_OF_UML 0x3ffu // components 0 to 9 (x87 to PKRU) end within 2696 bytes in the standard format

typedef long ptrace_fn(enum __ptrace_request request, ...);

static uint8_t whole[XSTATE_MAX]; // UML is one thread

static long set_xstate(ptrace_fn *next, pid_t pid, struct iovec *part)
{
    struct iovec all = {.iov_base = whole, .iov_len = sizeof whole};
    if (next(PTRACE_GETREGSET, pid, (void *)NT_X86_XSTATE, &all) != 0 || part->iov_len >= all.iov_len)
        return next(PTRACE_SETREGSET, pid, (void *)NT_X86_XSTATE, part);
    memcpy(whole, part->iov_base, part->iov_len);
    uint64_t components;
    memcpy(&components, whole + XSTATE_BV, sizeof components);
    components &= XSTATE_BV_OF_UML;
    memcpy(whole + XSTATE_BV, &components, sizeof components);
    return next(PTRACE_SETREGSET, pid, (void *)NT_X86_XSTATE, &all);
}

long ptrace(enum __ptrace_request request, ...)
{
    static ptrace_fn *next;
    if (!next) next = (ptrace_fn *)dlsym(RTLD_NEXT, "ptrace");
    va_list ap;
    va_start(ap, request);
    pid_t pid = va_arg(ap, pid_t);
    void *addr = va_arg(ap, void *);
    void *data = va_arg(ap, void *);
    va_end(ap);
    if (request == PTRACE_SETREGSET && addr == (void *)NT_X86_XSTATE) return set_xstate(next, pid, data);
    return next(request, pid, addr, data);
}
