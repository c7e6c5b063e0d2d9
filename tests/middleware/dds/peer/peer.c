#define _GNU_SOURCE
/* A peer on Cyclone DDS 0.10 with generated types: peer DOMAIN TYPE
   Sends every sample it receives on rt/there back on rt/back until its input ends, then exits with 0. */
#include <dlfcn.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "dds/dds.h"

/* The descriptor that idlc generated for a type, e.g. std_msgs_msg_dds__String__desc for std_msgs::msg::dds_::String_. */
static const dds_topic_descriptor_t *find (const char *type)
{
  char symbol[256];
  size_t n = 0;
  for (const char *c = type; *c && n < sizeof (symbol) - 8; c++)
    if (c[0] == ':') { symbol[n++] = '_'; c++; } else symbol[n++] = *c;
  strcpy (symbol + n, "_desc");
  return dlsym (NULL, symbol);
}

int main (int argc, char **argv)
{
  if (argc != 3) return 64;
  const dds_topic_descriptor_t *type = find (argv[2]);
  if (type == NULL) return 65;
  dds_qos_t *qos = dds_create_qos ();
  dds_qset_reliability (qos, DDS_RELIABILITY_RELIABLE, DDS_SECS (5));
  dds_qset_history (qos, DDS_HISTORY_KEEP_ALL, 0);
  dds_entity_t participant = dds_create_participant ((dds_domainid_t) atoi (argv[1]), NULL, NULL);
  dds_entity_t there = dds_create_topic (participant, type, "rt/there", NULL, NULL);
  dds_entity_t back = dds_create_topic (participant, type, "rt/back", NULL, NULL);
  dds_entity_t writer = dds_create_writer (participant, back, qos, NULL);
  dds_entity_t reader = dds_create_reader (participant, there, qos, NULL);
  if (participant < 0 || there < 0 || back < 0 || reader < 0 || writer < 0) return 66;
  struct pollfd input = { .fd = 0, .events = POLLIN };
  while (poll (&input, 1, 0) == 0)
  {
    void *sample = NULL;
    dds_sample_info_t info;
    int n = dds_take (reader, &sample, &info, 1, 1);
    if (n < 0) return 67;
    if (n == 0) { dds_sleepfor (DDS_MSECS (1)); continue; }
    if (info.valid_data && dds_write (writer, sample) < 0) return 68;
    if (dds_return_loan (reader, &sample, n) < 0) return 69;
  }
  if (dds_wait_for_acks (writer, DDS_SECS (5)) < 0) return 70;
  dds_delete (participant);
  dds_delete_qos (qos);
  return 0;
}
