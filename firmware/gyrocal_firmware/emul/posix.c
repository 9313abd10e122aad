/* The POSIX functions that programs need on an emulated CPU, by semihosting: the emulator's own files, output and command line.
   Standard input is always empty, and the time is constant, because only virtual time counts. */
#include "poll.h"

#include <semihost.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <sys/types.h>
#include <time.h>

#define MAX_ARGUMENTS 16
#define SEMIHOST_WRITE 4 /* fopen's "w" */

int gyrocal_main(int argc, char **argv); /* the program's own main, renamed by the compiler's command line */

static int semihost_stdout(void) {
    static int handle = -1;
    if (handle < 0) {
        handle = (int)sys_semihost_open(":tt", SEMIHOST_WRITE);
    }
    return handle;
}

ssize_t write(int fd, const void *data, size_t n) {
    (void)fd; /* standard error goes the same way */
    return (ssize_t)(n - (size_t)sys_semihost_write(semihost_stdout(), data, n));
}

int poll(struct pollfd *fds, unsigned n, int timeout_ms) {
    (void)fds;
    (void)n;
    (void)timeout_ms;
    return 0;
}

int fcntl(int fd, int command, ...) {
    (void)fd;
    (void)command;
    return -1;
}

int clock_gettime(clockid_t clock, struct timespec *t) {
    (void)clock;
    memset(t, 0, sizeof *t);
    return 0;
}

int nanosleep(const struct timespec *wanted, struct timespec *left) {
    (void)wanted;
    (void)left;
    return 0;
}

int main(void) {
    static char line[1024];
    static char *argv[MAX_ARGUMENTS + 1];
    int argc = 0;
    if (sys_semihost_get_cmdline(line, sizeof line) != 0) {
        return 2;
    }
    for (char *word = strtok(line, " "); word != NULL && argc < MAX_ARGUMENTS; word = strtok(NULL, " ")) {
        argv[argc++] = word;
    }
    return gyrocal_main(argc, argv);
}
