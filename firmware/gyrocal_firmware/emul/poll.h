/* The part of <poll.h> that sim/main.c needs on a CPU without an operating system. */
#ifndef POLL_H
#define POLL_H

#define POLLIN 1

struct pollfd {
    int fd;
    short events, revents;
};

int poll(struct pollfd *fds, unsigned n, int timeout_ms);

#endif
