/* A Modbus TCP machine on libmodbus: port, then seconds to live. Holding registers:
 * 0 counter, 1..2 float32 42.5, 3..6 int64 -5e12, 7..8 float32 with words swapped, 9 = 0x8000,
 * 10..259 their own address; input 0..1 uint32 milliseconds; coils and discrete inputs alternate.
 * The counter and the float at 260 change together with every request of a register that is not
 * the counter. */
#include <errno.h>
#include <modbus.h>
#include <stdlib.h>
#include <string.h>
#include <sys/select.h>
#include <sys/time.h>
#include <unistd.h>

static void put(uint16_t *words, float value, int swapped) {
    uint32_t bits;
    memcpy(&bits, &value, 4);
    words[swapped] = bits >> 16, words[!swapped] = bits & 0xffff;
}

int main(int argc, char **argv) {
    modbus_t *bus = modbus_new_tcp("127.0.0.1", atoi(argv[1]));
    modbus_mapping_t *map = modbus_mapping_new(40, 40, 300, 10);
    uint8_t query[MODBUS_TCP_MAX_ADU_LENGTH];
    fd_set all, ready;
    int i, top, line, listening, turns = 0, tear = argc > 2 ? atoi(argv[2]) : 0;
    for (i = 10; i < 260; i++) map->tab_registers[i] = i;
    for (i = 0; i < 40; i++) map->tab_bits[i] = i % 2, map->tab_input_bits[i] = i % 3 == 0;
    put(map->tab_registers + 1, 42.5, 0);
    int64_t big = -5000000000000LL;
    for (i = 0; i < 4; i++) map->tab_registers[3 + i] = (uint16_t)(big >> (48 - 16 * i));
    put(map->tab_registers + 7, -1.25, 1);
    map->tab_registers[9] = 0x8000;
    listening = modbus_tcp_listen(bus, 8);
    if (listening < 0) return 1;
    FD_ZERO(&all);
    FD_SET(listening, &all);
    top = listening;
    for (;;) {
        ready = all;
        if (select(top + 1, &ready, NULL, NULL, NULL) < 0) return 2;
        for (line = 0; line <= top; line++) {
            if (!FD_ISSET(line, &ready)) continue;
            if (line == listening) {
                int fresh = modbus_tcp_accept(bus, &listening);
                FD_SET(fresh, &all);
                top = fresh > top ? fresh : top;
                continue;
            }
            modbus_set_socket(bus, line);
            int size = modbus_receive(bus, query);
            if (size < 0) {
                close(line);
                FD_CLR(line, &all);
                continue;
            }
            struct timeval now;
            gettimeofday(&now, NULL);
            uint32_t ms = (uint32_t)(now.tv_sec % 100000 * 1000 + now.tv_usec / 1000);
            map->tab_input_registers[0] = ms >> 16, map->tab_input_registers[1] = ms & 0xffff;
            int counter = query[7] == 3 && query[8] == 0 && query[9] == 0 && query[11] == 1;
            if ((tear && !counter) || (!tear && counter && turns++ % 2 == 0)) {
                map->tab_registers[0]++;
                put(map->tab_registers + 260, map->tab_registers[0], 0);
            }
            modbus_reply(bus, query, size, map);
        }
    }
}
