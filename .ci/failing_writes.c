/* Preloaded by .ci/ledger: the Nth change of a regular file fails, as on a full or broken disk, and so do all behind it if
 * FAIL_MODE is "from". Counted are write, writev, pwrite, ftruncate, fsync, fdatasync and rename. The file FAIL_LOG gets one line
 * a failure that was made. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

static atomic_long seen = 0;

static int is_file(int fd) {
    struct stat of;
    return fstat(fd, &of) == 0 && S_ISREG(of.st_mode);
}

/* Whether this change is to fail. */
static int fails(const char *what) {
    static long nth = -1;
    static int from = 0;
    if (nth < 0) {
        const char *wanted = getenv("FAIL_NTH"), *mode = getenv("FAIL_MODE");
        from = mode && strcmp(mode, "from") == 0;
        nth = wanted ? atol(wanted) : 0;
    }
    long now = atomic_fetch_add(&seen, 1) + 1;
    if (nth == 0 || now < nth || (now > nth && !from)) return 0;
    const char *log = getenv("FAIL_LOG");
    if (log) {
        int fd = (int)syscall(SYS_openat, AT_FDCWD, log, O_WRONLY | O_CREAT | O_APPEND, 0644);
        if (fd >= 0) {
            char line[64];
            int n = snprintf(line, sizeof line, "%ld %s\n", now, what);
            syscall(SYS_write, fd, line, n);
            syscall(SYS_close, fd);
        }
    }
    return 1;
}

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))
#define REFUSE(what, error) do { if (fails(what)) { errno = error; return -1; } } while (0)

ssize_t write(int fd, const void *bytes, size_t n) {
    if (is_file(fd)) REFUSE("write", ENOSPC);
    return NEXT(write)(fd, bytes, n);
}
ssize_t writev(int fd, const struct iovec *parts, int n) {
    if (is_file(fd)) REFUSE("writev", ENOSPC);
    return NEXT(writev)(fd, parts, n);
}
ssize_t pwrite64(int fd, const void *bytes, size_t n, off64_t at) {
    if (is_file(fd)) REFUSE("pwrite", ENOSPC);
    return NEXT(pwrite64)(fd, bytes, n, at);
}
ssize_t pwrite(int fd, const void *bytes, size_t n, off_t at) {
    if (is_file(fd)) REFUSE("pwrite", ENOSPC);
    return NEXT(pwrite)(fd, bytes, n, at);
}
int ftruncate64(int fd, off64_t n) {
    REFUSE("ftruncate", ENOSPC);
    return NEXT(ftruncate64)(fd, n);
}
int fsync(int fd) {
    if (is_file(fd)) REFUSE("fsync", EIO);
    return NEXT(fsync)(fd);
}
int fdatasync(int fd) {
    if (is_file(fd)) REFUSE("fdatasync", EIO);
    return NEXT(fdatasync)(fd);
}
int rename(const char *from, const char *to) {
    REFUSE("rename", ENOSPC);
    return NEXT(rename)(from, to);
}
