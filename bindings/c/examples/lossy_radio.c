/* Three minds, one radio that loses every third message, virtual time: all hold the same decision in each of six rounds.
 *
 *   cargo build -p gestalt-c
 *   cc -Ibindings/c/include bindings/c/examples/lossy_radio.c target/debug/libgestalt_c.a -lpthread -ldl -lm -o lossy_radio
 *   ./lossy_radio
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gestalt.h"

enum { ROBOTS = 3, GESTURES = 3, ROUNDS = 6, MOST = 1024 };

static const uint64_t MS = 1000000;

/* What is on its way: a key, a payload, who said it, and for whom it is. */
typedef struct {
  char key[128];
  uint8_t payload[64 * 1024];
  size_t length;
  uint32_t from, to;
} Packet;

static void check(GestaltStatus status, const char *what) {
  if (status < 0) {
    char why[256];
    gestalt_last_error(why, sizeof why);
    fprintf(stderr, "%s: %s\n", what, why);
    exit(1);
  }
}

/* A generator of our own, so that the same seed loses the same messages: xorshift32. */
static uint32_t chance(void) {
  static uint32_t state = 2463534242u;
  state ^= state << 13;
  state ^= state >> 17;
  state ^= state << 5;
  return state;
}

/* Takes all that a mind wants said, and puts it on the air. */
static size_t listen(GestaltMind *mind, uint32_t robot, Packet *air, size_t packets) {
  while (packets < MOST) {
    Packet *packet = &air[packets];
    GestaltMessage message;
    memset(&message, 0, sizeof message);
    message.key = packet->key;
    message.key_capacity = sizeof packet->key;
    message.payload = packet->payload;
    message.payload_capacity = sizeof packet->payload;
    GestaltStatus status = gestalt_mind_next_message(mind, &message);
    check(status, "a message");
    if (status != GESTALT_STATUS_OK) break;
    packet->length = message.payload_length;
    packet->from = robot;
    packet->to = message.to;
    packets++;
  }
  return packets;
}

int main(void) {
  GestaltMind *minds[ROBOTS];
  Packet *air = (Packet *)malloc(MOST * sizeof *air);
  size_t packets = 0, lost = 0, carried = 0;
  char settings[256], decision[16 * 1024];
  if (!air) return 1;

  for (uint32_t i = 0; i < ROBOTS; i++) {
    snprintf(settings, sizeof settings,
             "{\"robot\": %u, \"boot\": 1, \"seed\": 42, \"vocabulary\": [\"left\", \"right\", \"stop\"]}", i + 1);
    check(gestalt_mind_new(settings, &minds[i]), "settings");
    uint32_t alive[ROBOTS], neighbours[ROBOTS];
    size_t others = 0;
    for (uint32_t j = 0; j < ROBOTS; j++) {
      alive[j] = j + 1;
      if (j != i) neighbours[others++] = j + 1;
    }
    check(gestalt_mind_set_alive(minds[i], 0, alive, ROBOTS), "who is alive");
    check(gestalt_mind_set_neighbours(minds[i], 0, neighbours, others), "who is near");
  }

  for (int round = 0; round < ROUNDS; round++) {
    int shown = round % GESTURES;
    uint64_t start = (1000 + 6000 * (uint64_t)round) * MS;
    for (uint64_t ms = 0; ms < 6000; ms += 10) {
      uint64_t now = start + ms * MS;
      if (ms == 0) check(gestalt_mind_open(minds[round % ROBOTS], now), "open");

      /* What was said ten milliseconds ago arrives now, or never. */
      for (size_t p = 0; p < packets; p++) {
        for (uint32_t i = 0; i < ROBOTS; i++) {
          if (air[p].from == i + 1 || (air[p].to != GESTALT_TO_ALL && air[p].to != i + 1)) continue;
          if (chance() % 3 == 0) {
            lost++;
            continue;
          }
          check(gestalt_mind_received(minds[i], now, air[p].key, air[p].payload, air[p].length), air[p].key);
          carried++;
        }
      }
      packets = 0;
      for (uint32_t i = 0; i < ROBOTS; i++) {
        if (gestalt_mind_is_open(minds[i]) == GESTALT_STATUS_OK && ms % 100 == 0) {
          /* Here a robot would look through its camera, and ask its classifier. */
          float seen[GESTURES] = {0.2f, 0.2f, 0.2f};
          seen[shown] = 0.6f;
          check(gestalt_mind_observe(minds[i], now, seen, GESTURES, 1.0f), "what was seen");
        }
        if (gestalt_mind_next_wake(minds[i]) <= now) check(gestalt_mind_tick(minds[i], now), "tick");
        packets = listen(minds[i], i + 1, air, packets);
      }
    }
    for (uint32_t i = 0; i < ROBOTS; i++) {
      char expected[16];
      snprintf(expected, sizeof expected, "\"class\":%d", shown);
      GestaltStatus status = gestalt_mind_decision(minds[i], decision, sizeof decision, NULL);
      if (status != GESTALT_STATUS_OK || !strstr(decision, expected)) {
        fprintf(stderr, "round %d: robot %u holds %s\n", round, i + 1, status ? "nothing" : decision);
        return 1;
      }
    }
    printf("round %d: all %d robots hold class %d\n", round, (int)ROBOTS, shown);
  }
  printf("%zu messages carried, %zu lost\n", carried, lost);

  for (uint32_t i = 0; i < ROBOTS; i++) gestalt_mind_free(minds[i]);
  free(air);
  return 0;
}
