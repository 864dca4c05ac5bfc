/* Embree behind a handful of functions, so that the program needs none of its structures, which change with versions.
   Robust mode, one thread, flags as its manual has them for each form. Rays are converted where they are traced, since
   our own kernels are given the same form. */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>

#if EMBREE == 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

enum { STREAM = 256 };

struct ray {
    float origin[3], direction[3], t_min, t_max;
};

struct answer {
    float t;
    uint32_t id;
};

struct tree {
    RTCDevice device;
    RTCScene scene;
    uint32_t triangles;
    int64_t bytes, peak;
};

/* One thread builds, so nothing needs to be atomic. */
static bool count(void *tree_, ssize_t bytes, bool post) {
    (void)post;
    struct tree *tree = tree_;
    tree->bytes += bytes;
    if (tree->bytes > tree->peak) {
        tree->peak = tree->bytes;
    }
    return true;
}

static void attach(struct tree *tree, unsigned id, enum RTCGeometryType type, const float *vertices, size_t stride,
                   size_t vertex_count, const uint32_t *indices, size_t triangles) {
    RTCGeometry geometry = rtcNewGeometry(tree->device, type);
    enum RTCFormat format = indices ? RTC_FORMAT_FLOAT3 : RTC_FORMAT_FLOAT4;
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, format, vertices, 0, stride, vertex_count);
    if (indices) {
        rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, indices, 0, 12, triangles);
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(tree->scene, geometry, id);
    rtcReleaseGeometry(geometry);
}

/* `vertices` are three floats each, and one more float may be read after the last; `spheres` are centre and radius. Both
   must outlive the tree. */
struct tree *hybray_embree_new(const float *vertices, size_t vertex_count, const uint32_t *indices, size_t triangles,
                               const float *spheres, size_t sphere_count) {
    struct tree *tree = calloc(1, sizeof *tree);
    if (!tree) {
        return NULL;
    }
    tree->device = rtcNewDevice("threads=1");
    if (!tree->device) {
        free(tree);
        return NULL;
    }
    rtcSetDeviceMemoryMonitorFunction(tree->device, count, tree);
    tree->triangles = (uint32_t)triangles;
    tree->scene = rtcNewScene(tree->device);
    rtcSetSceneFlags(tree->scene, RTC_SCENE_FLAG_ROBUST);
    if (triangles) {
        attach(tree, 0, RTC_GEOMETRY_TYPE_TRIANGLE, vertices, 12, vertex_count, indices, triangles);
    }
    if (sphere_count) {
        attach(tree, 1, RTC_GEOMETRY_TYPE_SPHERE_POINT, spheres, 16, sphere_count, NULL, 0);
    }
    rtcCommitScene(tree->scene);
    return tree;
}

void hybray_embree_free(struct tree *tree) {
    rtcReleaseScene(tree->scene);
    rtcReleaseDevice(tree->device);
    free(tree);
}

int64_t hybray_embree_kept(const struct tree *tree) { return tree->bytes; }

int64_t hybray_embree_peak(const struct tree *tree) { return tree->peak; }

/* As 31305 is 3.13.5. */
uint32_t hybray_embree_version(void) { return RTC_VERSION; }

#if EMBREE == 4
#define BEGIN(kind, coherent)                                                                                          \
    struct RTC##kind##Arguments context;                                                                               \
    rtcInit##kind##Arguments(&context);                                                                                \
    context.flags = (coherent) ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT
#define INTERSECT1(ray) rtcIntersect1(tree->scene, ray, &context)
#define OCCLUDED1(ray) rtcOccluded1(tree->scene, ray, &context)
#define INTERSECT16(valid, rays) rtcIntersect16(valid, tree->scene, rays, &context)
#define OCCLUDED16(valid, rays) rtcOccluded16(valid, tree->scene, rays, &context)
#else
#define BEGIN(kind, coherent)                                                                                          \
    struct RTCIntersectContext context;                                                                                \
    rtcInitIntersectContext(&context);                                                                                 \
    context.flags = (coherent) ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT
#define INTERSECT1(ray) rtcIntersect1(tree->scene, &context, ray)
#define OCCLUDED1(ray) rtcOccluded1(tree->scene, &context, ray)
#define INTERSECT16(valid, rays) rtcIntersect16(valid, tree->scene, &context, rays)
#define OCCLUDED16(valid, rays) rtcOccluded16(valid, tree->scene, &context, rays)
#endif

static struct answer nothing(void) { return (struct answer){INFINITY, UINT32_MAX}; }

static struct answer found(const struct tree *tree, float t, uint32_t geometry, uint32_t primitive) {
    if (geometry == RTC_INVALID_GEOMETRY_ID) {
        return nothing();
    }
    return (struct answer){t, geometry == 0 ? primitive : tree->triangles + primitive};
}

/* An occluded ray's end is set to minus infinity. */
static struct answer blocked(float t) { return t < 0.0f ? (struct answer){0.0f, 0} : nothing(); }

static void set(struct RTCRay *to, const struct ray *from) {
    to->org_x = from->origin[0];
    to->org_y = from->origin[1];
    to->org_z = from->origin[2];
    to->dir_x = from->direction[0];
    to->dir_y = from->direction[1];
    to->dir_z = from->direction[2];
    to->tnear = from->t_min;
    to->tfar = from->t_max;
    to->time = 0.0f;
    to->mask = UINT32_MAX;
    to->id = 0;
    to->flags = 0;
}

static void clear(struct RTCHit *hit) {
    hit->geomID = RTC_INVALID_GEOMETRY_ID;
    hit->instID[0] = RTC_INVALID_GEOMETRY_ID;
}

void hybray_embree_nearest(const struct tree *tree, const struct ray *rays, struct answer *out, size_t count) {
    BEGIN(Intersect, false);
    for (size_t i = 0; i < count; i++) {
        struct RTCRayHit ray;
        set(&ray.ray, &rays[i]);
        clear(&ray.hit);
        INTERSECT1(&ray);
        out[i] = found(tree, ray.ray.tfar, ray.hit.geomID, ray.hit.primID);
    }
}

void hybray_embree_occluded(const struct tree *tree, const struct ray *rays, struct answer *out, size_t count) {
    BEGIN(Occluded, false);
    for (size_t i = 0; i < count; i++) {
        struct RTCRay ray;
        set(&ray, &rays[i]);
        OCCLUDED1(&ray);
        out[i] = blocked(ray.tfar);
    }
}

/* Up to sixteen rays side by side; a lane without a ray is not valid. */
static void set16(struct RTCRay16 *to, int *valid, const struct ray *rays, size_t count) {
    for (size_t i = 0; i < 16; i++) {
        const struct ray *from = &rays[i < count ? i : 0];
        valid[i] = i < count ? -1 : 0;
        to->org_x[i] = from->origin[0];
        to->org_y[i] = from->origin[1];
        to->org_z[i] = from->origin[2];
        to->dir_x[i] = from->direction[0];
        to->dir_y[i] = from->direction[1];
        to->dir_z[i] = from->direction[2];
        to->tnear[i] = from->t_min;
        to->tfar[i] = from->t_max;
        to->time[i] = 0.0f;
        to->mask[i] = UINT32_MAX;
        to->id[i] = 0;
        to->flags[i] = 0;
    }
}

static size_t least(size_t a, size_t b) { return a < b ? a : b; }

void hybray_embree_nearest16(const struct tree *tree, const struct ray *rays, struct answer *out, size_t count,
                             bool coherent) {
    BEGIN(Intersect, coherent);
    for (size_t first = 0; first < count; first += 16) {
        size_t some = least(count - first, 16);
        _Alignas(64) int valid[16];
        struct RTCRayHit16 packet;
        set16(&packet.ray, valid, &rays[first], some);
        for (int i = 0; i < 16; i++) {
            packet.hit.geomID[i] = packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
        }
        INTERSECT16(valid, &packet);
        for (size_t i = 0; i < some; i++) {
            out[first + i] = found(tree, packet.ray.tfar[i], packet.hit.geomID[i], packet.hit.primID[i]);
        }
    }
}

void hybray_embree_occluded16(const struct tree *tree, const struct ray *rays, struct answer *out, size_t count,
                              bool coherent) {
    BEGIN(Occluded, coherent);
    for (size_t first = 0; first < count; first += 16) {
        size_t some = least(count - first, 16);
        _Alignas(64) int valid[16];
        struct RTCRay16 packet;
        set16(&packet, valid, &rays[first], some);
        OCCLUDED16(valid, &packet);
        for (size_t i = 0; i < some; i++) {
            out[first + i] = blocked(packet.tfar[i]);
        }
    }
}

#if EMBREE == 4

/* Version 4 has no streams: packets stand in for them, and the table says so. */
void hybray_embree_nearest_stream(const struct tree *tree, const struct ray *rays, struct answer *out, size_t count,
                                  bool coherent) {
    hybray_embree_nearest16(tree, rays, out, count, coherent);
}

void hybray_embree_occluded_stream(const struct tree *tree, const struct ray *rays, struct answer *out, size_t count,
                                   bool coherent) {
    hybray_embree_occluded16(tree, rays, out, count, coherent);
}

#else

void hybray_embree_nearest_stream(const struct tree *tree, const struct ray *rays, struct answer *out, size_t count,
                                  bool coherent) {
    BEGIN(Intersect, coherent);
    struct RTCRayHit stream[STREAM];
    for (size_t first = 0; first < count; first += STREAM) {
        size_t some = least(count - first, STREAM);
        for (size_t i = 0; i < some; i++) {
            set(&stream[i].ray, &rays[first + i]);
            clear(&stream[i].hit);
        }
        rtcIntersect1M(tree->scene, &context, stream, (unsigned)some, sizeof *stream);
        for (size_t i = 0; i < some; i++) {
            out[first + i] = found(tree, stream[i].ray.tfar, stream[i].hit.geomID, stream[i].hit.primID);
        }
    }
}

void hybray_embree_occluded_stream(const struct tree *tree, const struct ray *rays, struct answer *out, size_t count,
                                   bool coherent) {
    BEGIN(Occluded, coherent);
    struct RTCRay stream[STREAM];
    for (size_t first = 0; first < count; first += STREAM) {
        size_t some = least(count - first, STREAM);
        for (size_t i = 0; i < some; i++) {
            set(&stream[i], &rays[first + i]);
        }
        rtcOccluded1M(tree->scene, &context, stream, (unsigned)some, sizeof *stream);
        for (size_t i = 0; i < some; i++) {
            out[first + i] = blocked(stream[i].tfar);
        }
    }
}

#endif
