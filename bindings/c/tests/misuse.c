/* What a caller may do wrong: each is an error with words, and none ends the process. */
#undef NDEBUG
#include <assert.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gestalt.h"

static void says(const char *part) {
  char text[512];
  size_t length = gestalt_last_error(text, sizeof text);
  if (length == 0 || !strstr(text, part)) {
    fprintf(stderr, "'%s' does not name '%s'\n", text, part);
    abort();
  }
}

int main(int argc, char **argv) {
  const char *settings = "{\"robot\": 1, \"boot\": 1, \"seed\": 1, \"vocabulary\": [\"left\", \"right\"]}";
  GestaltMind *mind = (GestaltMind *)&argc;
  char small[4], text[4096];
  size_t length;
  assert(argc == 2);

  /* Null where there must be something. */
  assert(gestalt_last_error(NULL, 0) == 0);
  assert(gestalt_mind_new(NULL, &mind) == GESTALT_STATUS_ARGUMENT && mind == NULL);
  assert(gestalt_mind_new(settings, NULL) == GESTALT_STATUS_ARGUMENT);
  assert(gestalt_mind_tick(NULL, 0) == GESTALT_STATUS_ARGUMENT);
  says("mind is null");
  assert(gestalt_mind_next_wake(NULL) == GESTALT_NEVER);
  gestalt_mind_free(NULL);

  /* Settings that are none. */
  assert(gestalt_mind_new("{\"robot\": 1}", &mind) == GESTALT_STATUS_SETTINGS && mind == NULL);
  says("boot");
  assert(gestalt_mind_new("{\"robot\": 1, \"boot\": 1, \"seed\": 1, \"swarm\": \"a/b\"}", &mind) == GESTALT_STATUS_SETTINGS);
  says("a/b");
  assert(gestalt_mind_new("\xff", &mind) == GESTALT_STATUS_ARGUMENT);
  says("UTF-8");

  assert(gestalt_mind_new(settings, &mind) == GESTALT_STATUS_OK && mind != NULL);

  /* Observations that are none. */
  float seen[2] = {0.25f, 0.75f}, broken[2] = {NAN, 1.0f};
  assert(gestalt_mind_observe(mind, 0, broken, 2, 1.0f) == GESTALT_STATUS_ARGUMENT);
  says("NaN");
  assert(gestalt_mind_observe(mind, 0, seen, 1, 1.0f) == GESTALT_STATUS_ARGUMENT);
  assert(gestalt_mind_observe(mind, 0, NULL, 2, 1.0f) == GESTALT_STATUS_ARGUMENT);
  assert(gestalt_mind_observe(mind, 0, seen, SIZE_MAX / 2, 1.0f) == GESTALT_STATUS_ARGUMENT);
  assert(gestalt_mind_observe(mind, 0, seen, 2, 2.0f) == GESTALT_STATUS_ARGUMENT);

  /* Bytes that are none. */
  for (int n = 0; n < 2000; n++) {
    uint8_t noise[64];
    for (size_t i = 0; i < sizeof noise; i++) noise[i] = (uint8_t)(rand() >> 4);
    noise[0] = 3;
    (void)gestalt_mind_received(mind, 1, NULL, noise, (size_t)n % sizeof noise);
    (void)gestalt_mind_received(mind, 1, "gestalt/gestalt/decision", noise, (size_t)n % sizeof noise);
  }
  assert(gestalt_mind_received(mind, 1, NULL, NULL, 0) == GESTALT_STATUS_MESSAGE);
  assert(gestalt_mind_received(mind, 1, "gestalt/other/decision", NULL, 0) == GESTALT_STATUS_MESSAGE);
  assert(gestalt_mind_instructed(mind, 1, "a/b", 1, "{}") == GESTALT_STATUS_ARGUMENT);
  assert(gestalt_mind_instructed(mind, 1, "ada", 1, "{\"say\": \"shout\"}") == GESTALT_STATUS_MESSAGE);

  /* Models that are none, and one that tells other gestures apart. */
  assert(gestalt_mind_load_model(mind, 1, "/nowhere") == GESTALT_STATUS_MODEL);
  says("/nowhere");
  assert(gestalt_mind_load_model(mind, 1, "/") == GESTALT_STATUS_MODEL);
  assert(gestalt_mind_load_model(mind, 1, argv[1]) == GESTALT_STATUS_MODEL);
  says("vocabulary");

  /* Buffers that are too small lose nothing, and are not written over. */
  assert(gestalt_mind_decision(mind, text, sizeof text, NULL) == GESTALT_STATUS_NOTHING);
  assert(gestalt_mind_open(mind, 2) == GESTALT_STATUS_OK);
  assert(gestalt_mind_tick(mind, UINT64_C(1000000000)) == GESTALT_STATUS_OK);
  GestaltMessage message;
  /* Four fields are the caller's; the rest may be anything before. */
  memset(&message, 0xAA, sizeof message);
  message.key = NULL;
  message.key_capacity = 0;
  message.payload = NULL;
  message.payload_capacity = 0;
  assert(gestalt_mind_next_message(mind, NULL) == GESTALT_STATUS_ARGUMENT);
  assert(gestalt_mind_next_message(mind, &message) == GESTALT_STATUS_TOO_SMALL);
  assert(message.payload_length > 0 && message.to == GESTALT_TO_ALL && !message.json);
  /* Exactly as much as is needed, so that one byte too many is found out. */
  message.key_capacity = message.key_length + 1;
  message.payload_capacity = message.payload_length;
  message.key = (char *)malloc(message.key_capacity);
  message.payload = (uint8_t *)malloc(message.payload_capacity);
  assert(gestalt_mind_next_message(mind, &message) == GESTALT_STATUS_OK);
  assert(strcmp(message.key, "gestalt/gestalt/robot/1/vote") == 0);
  free(message.key);
  free(message.payload);
  memset(small, 'x', sizeof small);
  assert(gestalt_mind_status(mind, small, sizeof small, &length) == GESTALT_STATUS_TOO_SMALL);
  assert(length > sizeof small && small[0] == 'x');
  char *exact = (char *)malloc(length + 1);
  assert(gestalt_mind_status(mind, exact, length + 1, &length) == GESTALT_STATUS_OK && strlen(exact) == length);
  free(exact);
  gestalt_mind_free(mind);

  /* With a model, features: a mind that learns is taught, shares and trains. */
  assert(gestalt_mind_new("{\"robot\": 1, \"boot\": 1, \"seed\": 1, \"learning\": {\"spacing\": \"0s\"}}", &mind) == GESTALT_STATUS_OK);
  assert(gestalt_mind_observe(mind, 0, seen, 2, 1.0f) == GESTALT_STATUS_ARGUMENT);
  says("no model");
  assert(gestalt_mind_load_model(mind, 0, argv[1]) == GESTALT_STATUS_OK);
  assert(gestalt_mind_train(mind, 1) == GESTALT_STATUS_NOTHING);
  assert(gestalt_mind_open(mind, 1) == GESTALT_STATUS_OK);
  assert(gestalt_mind_load_model(mind, 2, argv[1]) == GESTALT_STATUS_MODEL);
  gestalt_mind_free(mind);
  puts("every misuse was refused");
  return 0;
}
