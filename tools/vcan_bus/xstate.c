/* Loaded into linux.uml (LD_PRELOAD) on processors with AMX.
 *
 * User-mode-linux keeps 2696 bytes of floating point state per process, enough up to AVX-512 and
 * protection keys. With AMX the host's state has 11008 bytes, and the host refuses to set anything
 * but all of it (PTRACE_SETREGSET: EFAULT), so that the guest dies at its first process. Here what
 * is missing is filled up: AMX in its initial state, which no process of the guest can leave, since
 * it cannot ask for the permission. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdarg.h>
#include <stdint.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/uio.h>

#define NT_X86_XSTATE 0x202
#define HEADER 512              /* offset of the bit field of the parts that are not initial */
#define AMX (UINT64_C(3) << 17) /* tile configuration and tile data */

static char state[1 << 16] __attribute__((aligned(64)));
static size_t whole; /* of the host's state, bytes */

long ptrace(enum __ptrace_request request, ...) {
    static long (*real)(int, ...);
    va_list arguments;
    va_start(arguments, request);
    pid_t process = va_arg(arguments, pid_t);
    void *address = va_arg(arguments, void *);
    struct iovec *data = va_arg(arguments, struct iovec *);
    va_end(arguments);
    if (real == NULL)
        real = (long (*)(int, ...))dlsym(RTLD_NEXT, "ptrace");
    if ((int)request != PTRACE_SETREGSET || address != (void *)NT_X86_XSTATE)
        return real(request, process, address, data);
    if (whole == 0) {
        struct iovec all = {state, sizeof state};
        if (real(PTRACE_GETREGSET, process, address, &all) < 0)
            return -1;
        whole = all.iov_len;
    }
    if (data->iov_len >= whole)
        return real(request, process, address, data);
    memcpy(state, data->iov_base, data->iov_len);
    *(uint64_t *)(state + HEADER) &= ~AMX;
    struct iovec all = {state, whole};
    return real(request, process, address, &all);
}
