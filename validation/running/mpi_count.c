/* Counts what a rank hands to MPI.  Preloaded, it stands between a program and the MPI library, by MPI's own
   profiling interface.  counting.py compiles it and reads the file that each rank leaves in MPI_Finalize.

   MPI_Pcontrol(0) stops the counting and MPI_Pcontrol(1) lets it go on.

   A message is a send to any rank, its bytes those of its data.  The bytes of a collective are those of the
   buffer that this rank hands in (MPI_Bcast: of the one buffer that there is). */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <execinfo.h>
#include <mpi.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct counts {
  long long messages, bytes, collectives, collective_bytes;
};

static struct counts all, of_fixes;
static int on = 1;

/* Whether LAMMPS's class Modify, which calls the fixes, is among the callers. */
static int called_by_fix(void)
{
  void *frames[100];
  Dl_info where;
  const int n = backtrace(frames, 100);
  for (int i = 0; i < n; i++)
    if (dladdr(frames[i], &where) && where.dli_sname && strstr(where.dli_sname, "N9LAMMPS_NS6Modify")) return 1;
  return 0;
}

static void add(struct counts *counts, struct counts more)
{
  counts->messages += more.messages;
  counts->bytes += more.bytes;
  counts->collectives += more.collectives;
  counts->collective_bytes += more.collective_bytes;
}

static void note(struct counts more)
{
  if (!on) return;
  add(&all, more);
  if (called_by_fix()) add(&of_fixes, more);
}

static long long size(long long n, MPI_Datatype type)
{
  int each;
  PMPI_Type_size(type, &each);
  return n * each;
}

static void message(long long n, MPI_Datatype type, int to)
{
  if (to != MPI_PROC_NULL) note((struct counts) {1, size(n, type), 0, 0});
}

static void collective(long long bytes)
{
  note((struct counts) {0, 0, 1, bytes});
}

static int ranks(MPI_Comm comm)
{
  int n;
  PMPI_Comm_size(comm, &n);
  return n;
}

static int is_root(int root, MPI_Comm comm)
{
  int rank;
  PMPI_Comm_rank(comm, &rank);
  return rank == root;
}

int MPI_Pcontrol(const int level, ...)
{
  on = level != 0;
  return MPI_SUCCESS;
}

static void print(FILE *file, const char *of, struct counts counts, const char *end)
{
  fprintf(file, "\"%smessages\": %lld, \"%sbytes\": %lld, \"%scollectives\": %lld, \"%scollective_bytes\": %lld%s\n", of,
          counts.messages, of, counts.bytes, of, counts.collectives, of, counts.collective_bytes, end);
}

int MPI_Finalize(void)
{
  char path[4096];
  int rank;
  PMPI_Comm_rank(MPI_COMM_WORLD, &rank);
  snprintf(path, sizeof path, "%s/%d.json", getenv("MPI_COUNT_FOLDER"), rank);
  FILE *file = fopen(path, "w");
  if (file) {
    fputs("{", file);
    print(file, "", all, ",");
    print(file, "fix_", of_fixes, "}");
    fclose(file);
  } else
    perror(path);
  return PMPI_Finalize();
}

/* Persistent sends: each start is a message. */

static struct persistent {
  MPI_Request request;
  long long bytes;
} *persistent;
static int npersistent;

static void made(MPI_Request request, long long n, MPI_Datatype type, int to)
{
  if (to == MPI_PROC_NULL) return;
  persistent = realloc(persistent, (npersistent + 1) * sizeof *persistent);
  persistent[npersistent++] = (struct persistent) {request, size(n, type)};
}

static void started(MPI_Request request)
{
  for (int i = 0; i < npersistent; i++)
    if (persistent[i].request == request) note((struct counts) {1, persistent[i].bytes, 0, 0});
}

int MPI_Start(MPI_Request *request)
{
  started(*request);
  return PMPI_Start(request);
}

int MPI_Startall(int n, MPI_Request requests[])
{
  for (int i = 0; i < n; i++) started(requests[i]);
  return PMPI_Startall(n, requests);
}

int MPI_Request_free(MPI_Request *request)
{
  for (int i = 0; i < npersistent; i++)
    if (persistent[i].request == *request) persistent[i] = persistent[--npersistent];
  return PMPI_Request_free(request);
}

/* All others: note what the call is, and do it. */

#define CALL(name, parameters, arguments, what) \
  int MPI_##name parameters \
  { \
    what; \
    return PMPI_##name arguments; \
  }

CALL(Barrier, (MPI_Comm c), (c), collective(0))
CALL(Ibarrier, (MPI_Comm c, MPI_Request *r), (c, r), collective(0))

/* with counts of type int, and again with large ones */

#define SEND(name, N) \
  CALL(name, (const void *a, N n, MPI_Datatype t, int to, int tag, MPI_Comm c), (a, n, t, to, tag, c), message(n, t, to))

#define ISEND(name, N) \
  CALL(name, (const void *a, N n, MPI_Datatype t, int to, int tag, MPI_Comm c, MPI_Request *r), (a, n, t, to, tag, c, r), \
       message(n, t, to))

#define SEND_INIT(name, N) \
  int MPI_##name(const void *a, N n, MPI_Datatype t, int to, int tag, MPI_Comm c, MPI_Request *r) \
  { \
    const int outcome = PMPI_##name(a, n, t, to, tag, c, r); \
    made(*r, n, t, to); \
    return outcome; \
  }

#define REDUCE(name, N) \
  CALL(name, (const void *a, void *b, N n, MPI_Datatype t, MPI_Op op, MPI_Comm c), (a, b, n, t, op, c), collective(size(n, t)))

/* a may be MPI_IN_PLACE, with no type */
#define GIVEN(times) collective((times) * (a == MPI_IN_PLACE ? size(m, u) : size(n, t)))

#define CALLS(s, N, DISPLACEMENT) \
  SEND(Send##s, N) \
  SEND(Ssend##s, N) \
  SEND(Rsend##s, N) \
  SEND(Bsend##s, N) \
  ISEND(Isend##s, N) \
  ISEND(Issend##s, N) \
  ISEND(Irsend##s, N) \
  ISEND(Ibsend##s, N) \
  SEND_INIT(Send_init##s, N) \
  SEND_INIT(Ssend_init##s, N) \
  SEND_INIT(Rsend_init##s, N) \
  SEND_INIT(Bsend_init##s, N) \
  CALL(Sendrecv##s, \
       (const void *a, N n, MPI_Datatype t, int to, int tag, void *b, N m, MPI_Datatype u, int from, int its, MPI_Comm c, MPI_Status *x), \
       (a, n, t, to, tag, b, m, u, from, its, c, x), message(n, t, to)) \
  CALL(Sendrecv_replace##s, (void *a, N n, MPI_Datatype t, int to, int tag, int from, int its, MPI_Comm c, MPI_Status *x), \
       (a, n, t, to, tag, from, its, c, x), message(n, t, to)) \
  REDUCE(Allreduce##s, N) \
  REDUCE(Scan##s, N) \
  REDUCE(Exscan##s, N) \
  REDUCE(Reduce_scatter_block##s, N) \
  CALL(Iallreduce##s, (const void *a, void *b, N n, MPI_Datatype t, MPI_Op op, MPI_Comm c, MPI_Request *r), (a, b, n, t, op, c, r), \
       collective(size(n, t))) \
  CALL(Reduce##s, (const void *a, void *b, N n, MPI_Datatype t, MPI_Op op, int root, MPI_Comm c), (a, b, n, t, op, root, c), \
       collective(size(n, t))) \
  CALL(Bcast##s, (void *a, N n, MPI_Datatype t, int root, MPI_Comm c), (a, n, t, root, c), collective(size(n, t))) \
  CALL(Allgather##s, (const void *a, N n, MPI_Datatype t, void *b, N m, MPI_Datatype u, MPI_Comm c), (a, n, t, b, m, u, c), GIVEN(1)) \
  CALL(Alltoall##s, (const void *a, N n, MPI_Datatype t, void *b, N m, MPI_Datatype u, MPI_Comm c), (a, n, t, b, m, u, c), GIVEN(ranks(c))) \
  CALL(Gather##s, (const void *a, N n, MPI_Datatype t, void *b, N m, MPI_Datatype u, int root, MPI_Comm c), \
       (a, n, t, b, m, u, root, c), GIVEN(1)) \
  CALL(Scatter##s, (const void *a, N n, MPI_Datatype t, void *b, N m, MPI_Datatype u, int root, MPI_Comm c), \
       (a, n, t, b, m, u, root, c), collective(is_root(root, c) ? ranks(c) * size(n, t) : 0)) \
  CALL(Allgatherv##s, (const void *a, N n, MPI_Datatype t, void *b, const N m[], const DISPLACEMENT d[], MPI_Datatype u, MPI_Comm c), \
       (a, n, t, b, m, d, u, c), collective(a == MPI_IN_PLACE ? 0 : size(n, t))) \
  CALL(Gatherv##s, (const void *a, N n, MPI_Datatype t, void *b, const N m[], const DISPLACEMENT d[], MPI_Datatype u, int root, MPI_Comm c), \
       (a, n, t, b, m, d, u, root, c), collective(a == MPI_IN_PLACE ? 0 : size(n, t))) \
  CALL(Scatterv##s, (const void *a, const N n[], const DISPLACEMENT d[], MPI_Datatype t, void *b, N m, MPI_Datatype u, int root, MPI_Comm c), \
       (a, n, d, t, b, m, u, root, c), collective(is_root(root, c) ? size(sum##s(n, c), t) : 0)) \
  CALL(Reduce_scatter##s, (const void *a, void *b, const N n[], MPI_Datatype t, MPI_Op op, MPI_Comm c), (a, b, n, t, op, c), \
       collective(size(sum##s(n, c), t))) \
  CALL(Alltoallv##s, \
       (const void *a, const N n[], const DISPLACEMENT d[], MPI_Datatype t, void *b, const N m[], const DISPLACEMENT e[], MPI_Datatype u, \
        MPI_Comm c), \
       (a, n, d, t, b, m, e, u, c), collective(a == MPI_IN_PLACE ? size(sum##s(m, c), u) : size(sum##s(n, c), t)))

#define SUM(name, N) \
  static long long name(const N n[], MPI_Comm c) \
  { \
    long long total = 0; \
    for (int i = 0; i < ranks(c); i++) total += n[i]; \
    return total; \
  }

SUM(sum, int)
CALLS(, int, int)
#if MPI_VERSION >= 4
SUM(sum_c, MPI_Count)
CALLS(_c, MPI_Count, MPI_Aint)
#endif
