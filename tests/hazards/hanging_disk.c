/* A disk that hangs, loaded before libc: who waits for a file of the records waits for ever. */
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/syscall.h>
#include <unistd.h>

int fsync(int fd) {
    char name[32], path[PATH_MAX] = "";
    snprintf(name, sizeof name, "/proc/self/fd/%d", fd);
    if (readlink(name, path, sizeof path - 1) > 0 && strstr(path, "/records/")) {
        for (;;) {
            pause();
        }
    }
    return syscall(SYS_fsync, fd);
}
