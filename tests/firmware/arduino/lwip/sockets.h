/* lwIP's sockets: its functions, with this computer's types and constants. */
#ifndef LWIP_SOCKETS_H
#define LWIP_SOCKETS_H

#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

extern "C" {
int lwip_socket(int domain, int type, int protocol);
int lwip_bind(int s, const struct sockaddr *name, socklen_t length);
int lwip_listen(int s, int backlog);
int lwip_accept(int s, struct sockaddr *from, socklen_t *length);
int lwip_setsockopt(int s, int level, int option, const void *value, socklen_t length);
int lwip_fcntl(int s, int command, int value);
ssize_t lwip_recv(int s, void *data, size_t n, int flags);
ssize_t lwip_send(int s, const void *data, size_t n, int flags);
int lwip_shutdown(int s, int how);
int lwip_close(int s);
}

#endif
