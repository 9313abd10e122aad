#include "wireless.h"

#include "flash_store.h"
#include "gc_error.h"
#include "gc_wifi.h"
#include "output.h"

#include <Arduino.h>
#include <ESPmDNS.h>
#include <WiFi.h>
#include <errno.h>
#include <freertos/FreeRTOS.h>
#include <freertos/semphr.h>
#include <lwip/sockets.h>
#include <stdio.h>
#include <string.h>

#define AGAIN_MS 15000u /* until a network that was not joined is tried again */
#define PIECE_BYTES 1436 /* of a packet */
#define BACKLOG 2
#define LINGER_MS 1000u
#define QUIET_S 5 /* a reader of whom nothing comes for so long is asked by TCP so many times, a second apart, */
#define ASKS 3    /* whether it is there */

static SemaphoreHandle_t mutex; /* of the four that follow, which other tasks change or look at */
static FlashStore flash;
static gc_wifi_t kept;
static bool is_changed; /* since the main loop last looked */
static gc_wifi_state_t state;

static gc_wifi_t used; /* by the main loop, as the rest */
static bool is_on, is_joined;
static uint32_t tried_ms;
static char host[sizeof gc_wifi_state_t::host];
static int server = -1, client = -1, leaving = -1;
static uint32_t left_ms;

struct Taken {
    Taken() { xSemaphoreTake(mutex, portMAX_DELAY); }
    ~Taken() { xSemaphoreGive(mutex); }
};

static gc_port_t make_store() {
    gc_port_t port = {};
    port.store = [](void *, const char *key, const void *data, size_t n) { return flash.store(key, data, n); };
    port.load = [](void *, const char *key, void *data, size_t n) { return flash.load(key, data, n); };
    return port;
}

static const gc_port_t store = make_store();

void wifi_begin() {
    mutex = xSemaphoreCreateMutex();
    flash.begin("board");
    gc_wifi_load(&kept, &store);
    is_changed = true;
    uint8_t mac[6] = {};
    WiFi.macAddress(mac);
    snprintf(host, sizeof host, "gyrocal-%02x%02x%02x", mac[3], mac[4], mac[5]);
}

const char *wifi_host() {
    return host;
}

const char *wifi_token() {
    return used.token;
}

/* Every sensor hears the command; the first one changes what is kept. */
int wifi_obey(void *, gc_wifi_word_t word, const char *text, size_t n) {
    const Taken taken;
    const gc_wifi_t before = kept;
    int error = gc_wifi_set(&kept, word, {text, n});
    if (error == GC_OK && memcmp(&before, &kept, sizeof kept) != 0) {
        error = gc_wifi_save(&kept, &store);
        is_changed = true;
    }
    return error;
}

void wifi_state(void *, gc_wifi_state_t *told) {
    const Taken taken;
    *told = state;
    told->reader = radio_has_reader();
    told->refused = radio_refused();
}

static void set_state(const char *word, const char *address) {
    const Taken taken;
    state.state = word;
    state.port = GC_WIFI_PORT;
    snprintf(state.address, sizeof state.address, "%s", address);
    snprintf(state.host, sizeof state.host, "%s", address[0] != '\0' ? host : "");
}

/* ---- the reader ---- */

static void hang_up() {
    if (client >= 0) {
        lwip_close(client);
        client = -1;
        radio_disconnect();
    }
}

static bool would_wait() {
    return errno == EWOULDBLOCK || errno == EAGAIN;
}

/* lwIP breaks a connection off that is closed with something unread, and the note would be lost. So the other side closes first, or
   LINGER_MS pass. */
static void linger(bool at_once) {
    char data[64];
    const int n = leaving >= 0 ? lwip_recv(leaving, data, sizeof data, MSG_DONTWAIT) : 0;
    if (leaving >= 0 && (at_once || n == 0 || (n < 0 && !would_wait()) || millis() - left_ms >= LINGER_MS)) {
        lwip_close(leaving);
        leaving = -1;
    }
}

static void turn_away(int socket, const char *note) {
    linger(true);
    lwip_send(socket, note, strlen(note), MSG_DONTWAIT);
    lwip_shutdown(socket, SHUT_WR);
    leaving = socket;
    left_ms = millis();
}

static void set(int socket, int level, int option, int value) {
    lwip_setsockopt(socket, level, option, &value, sizeof value);
}

static void accept_reader() {
    const int comer = lwip_accept(server, nullptr, nullptr);
    if (comer < 0) {
        return;
    }
    if (!radio_connect()) {
        turn_away(comer, GC_REMOTE_BUSY_NOTE);
        return;
    }
    client = comer;
    set(client, IPPROTO_TCP, TCP_NODELAY, 1);
    set(client, SOL_SOCKET, SO_KEEPALIVE, 1);
    set(client, IPPROTO_TCP, TCP_KEEPIDLE, QUIET_S);
    set(client, IPPROTO_TCP, TCP_KEEPINTVL, 1);
    set(client, IPPROTO_TCP, TCP_KEEPCNT, ASKS);
}

static void hear_reader(radio_command_t command) {
    char data[128];
    const int n = lwip_recv(client, data, sizeof data, MSG_DONTWAIT);
    if (n == 0 || (n < 0 && !would_wait())) {
        hang_up();
    } else if (n > 0 && !radio_hear(data, static_cast<size_t>(n), command)) {
        turn_away(client, GC_REMOTE_TOKEN_NOTE);
        client = -1;
        radio_disconnect();
    }
}

static void tell_reader() {
    const char *data = nullptr;
    size_t n;
    while (client >= 0 && (n = radio_waiting(PIECE_BYTES, &data)) > 0) {
        const int sent = lwip_send(client, data, n, MSG_DONTWAIT);
        if (sent <= 0) {
            if (!would_wait()) {
                hang_up();
            }
            return;
        }
        radio_took(static_cast<size_t>(sent));
    }
}

static void serve(radio_command_t command) {
    linger(false);
    accept_reader();
    if (client >= 0) {
        hear_reader(command);
        tell_reader();
    }
    if (client >= 0 && radio_is_over()) {
        hang_up();
    }
}

/* ---- the network ---- */

static void close_all() {
    hang_up();
    linger(true);
    if (server >= 0) {
        lwip_close(server);
        server = -1;
    }
    MDNS.end();
}

static bool open_server() {
    server = lwip_socket(AF_INET, SOCK_STREAM, 0);
    if (server < 0) {
        return false;
    }
    sockaddr_in any = {};
    any.sin_family = AF_INET;
    any.sin_port = htons(GC_WIFI_PORT);
    any.sin_addr.s_addr = htonl(INADDR_ANY);
    set(server, SOL_SOCKET, SO_REUSEADDR, 1);
    return lwip_bind(server, reinterpret_cast<const sockaddr *>(&any), sizeof any) == 0 && lwip_listen(server, BACKLOG) == 0 &&
           lwip_fcntl(server, F_SETFL, O_NONBLOCK) == 0;
}

static void join() {
    WiFi.persistent(false); /* what is kept is kept here */
    WiFi.setHostname(host);
    WiFi.mode(WIFI_STA);
    WiFi.begin(used.name, used.password[0] != '\0' ? used.password : nullptr);
    tried_ms = millis();
}

static bool take_changes() {
    const Taken taken;
    const bool any = is_changed;
    is_changed = false;
    used = kept;
    return any;
}

static void begin_anew() {
    if (is_on) {
        close_all();
        WiFi.disconnect(true);
    }
    is_joined = false;
    is_on = used.on != 0 && radio_begin(used.token);
    set_state(is_on ? "joining" : "off", "");
    if (is_on) {
        output_say("wifi: joining \"%s\"", used.name);
        join();
    } else if (used.on != 0) {
        output_say("wifi: no memory for it: connect fewer sensors");
    }
}

static void look_at_network() {
    const bool was_joined = is_joined;
    is_joined = WiFi.status() == WL_CONNECTED;
    if (is_joined && !was_joined) {
        const String address = WiFi.localIP().toString();
        const bool is_served = open_server();
        const bool is_named = MDNS.begin(host) && MDNS.addService("gyrocal", "tcp", GC_WIFI_PORT);
        output_say("wifi: %s tcp://%s:%d, name %s.local%s", is_served ? "readers come to" : "no socket for", address.c_str(),
                   GC_WIFI_PORT, host, is_named ? "" : ", which is not announced");
        set_state("joined", address.c_str());
    } else if (!is_joined && was_joined) {
        output_say("wifi: the network is lost, joining it again");
        set_state("joining", "");
        close_all();
        tried_ms = millis();
    } else if (!is_joined && millis() - tried_ms >= AGAIN_MS) {
        output_say("wifi: not joined yet (status %d): check name and password", static_cast<int>(WiFi.status()));
        WiFi.disconnect();
        join();
    }
}

void wifi_step(radio_command_t command) {
    if (take_changes()) {
        begin_anew();
    }
    if (is_on) {
        look_at_network();
    }
    if (server >= 0) {
        serve(command);
    }
}
