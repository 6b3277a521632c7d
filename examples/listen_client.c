/* Sends a live loop's messages to `seamlog record --listen tcp://127.0.0.1:5577 -o weld.mcap`.
   Build: cc -O2 listen_client.c -lzmq -lm -o listen_client.  Run: ./listen_client [ADDRESS]
   Wire format: docs/howto/record-from-another-language.md (numbers are little endian). */
#include <math.h>
#include <stdint.h>
#include <string.h>
#include <time.h>
#include <zmq.h>

static int64_t now_ns(void) {
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

/* 0 when the message was taken, -1 when the queue is full: the loop goes on either way. */
static int send_numbers(void *socket, const char *topic, int count, const double *values) {
    char body[8 + 8 * 8];
    int64_t stamp = now_ns();
    memcpy(body, &stamp, 8);
    memcpy(body + 8, values, 8 * (size_t)count);
    if (zmq_send(socket, topic, strlen(topic), ZMQ_SNDMORE | ZMQ_DONTWAIT) < 0) return -1;
    return zmq_send(socket, body, 8 + 8 * (size_t)count, ZMQ_DONTWAIT) < 0 ? -1 : 0;
}

int main(int argc, char **argv) {
    void *context = zmq_ctx_new(), *socket = zmq_socket(context, ZMQ_PUSH);
    struct timespec period = {0, 1000000};
    int waiting = 100000; /* messages kept here while the recorder starts or is away */
    zmq_setsockopt(socket, ZMQ_SNDHWM, &waiting, sizeof waiting);
    if (zmq_connect(socket, argc > 1 ? argv[1] : "tcp://127.0.0.1:5577")) return 1;
    for (int k = 0; k < 1000; k++) { /* the control loop: 1 kHz for one second */
        double t = k * 0.001, encoder[2] = {0.1 * sin(t), 0.1 * cos(t)}, command[2] = {2.0, 0.0};
        send_numbers(socket, "/table/encoder", 2, encoder);
        send_numbers(socket, "/table/command", 2, command);
        nanosleep(&period, NULL);
    }
    zmq_send(socket, "end", 3, 0);
    zmq_close(socket);
    return zmq_ctx_term(context);
}
