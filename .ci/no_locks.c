/* Preloaded by tests/all/no_locks.rs: a disk without the locks of fcntl, and with NO_FLOCK without any, as mounts of NFS, Lustre and
 * GPFS may be. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdlib.h>
#include <sys/file.h>

static int asks_for_a_lock(int command) {
    switch (command) {
    case F_GETLK:
    case F_SETLK:
    case F_SETLKW:
    case F_OFD_GETLK:
    case F_OFD_SETLK:
    case F_OFD_SETLKW:
        return 1;
    default:
        return 0;
    }
}

static int refused(void) {
    const char *number = getenv("NO_LOCKS_ERRNO");
    errno = number ? atoi(number) : ENOLCK;
    return -1;
}

#define PASSED_ON(name)                                                        \
    int name(int fd, int command, ...) {                                       \
        va_list more;                                                          \
        va_start(more, command);                                               \
        void *argument = va_arg(more, void *);                                 \
        va_end(more);                                                          \
        if (asks_for_a_lock(command)) return refused();                        \
        return ((int (*)(int, int, ...))dlsym(RTLD_NEXT, #name))(fd, command, argument); \
    }
PASSED_ON(fcntl)
PASSED_ON(fcntl64)

int flock(int fd, int operation) {
    if (getenv("NO_FLOCK")) return refused();
    return ((int (*)(int, int))dlsym(RTLD_NEXT, "flock"))(fd, operation);
}
