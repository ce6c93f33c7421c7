/* A camera behind the kernel's V4L2 interface, for tests on machines without one: preloaded, it answers the system calls on a
 * path that leads to /dev/null and is opened as video devices are. Where V4L2_CAMERA, the path, is gone, so is the camera.
 * Images: 64x48, or 32x24, stamped 7 ms before they arrive; GREY and YUYV of brightness 10 * number, MJPG from the file V4L2_JPEG.
 * Controls that are set are written to V4L2_LOG. All other calls go straight to the kernel. */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#define MOST_BUFFERS 8
#define BYTES 65536
#define AGE_US 7000 /* from exposure to the image's arrival */

static int camera = -1, n_queued, queue[MOST_BUFFERS];
static unsigned width = 64, height = 48, format = V4L2_PIX_FMT_YUYV, number, rate = 30;
static unsigned char *memory[MOST_BUFFERS];
static const struct { unsigned id; const char *name; int type, low, high; } controls[] = {
    {0x00980001, "User Controls", V4L2_CTRL_TYPE_CTRL_CLASS, 0, 0},
    {V4L2_CID_BRIGHTNESS, "Brightness", V4L2_CTRL_TYPE_INTEGER, -64, 64},
    {V4L2_CID_GAIN, "Gain", V4L2_CTRL_TYPE_INTEGER, 0, 100},
    {V4L2_CID_EXPOSURE_AUTO, "Auto Exposure", V4L2_CTRL_TYPE_MENU, 0, 3},
    {V4L2_CID_EXPOSURE_ABSOLUTE, "Exposure Time, Absolute", V4L2_CTRL_TYPE_INTEGER, 1, 5000},
};
static const int n_controls = sizeof controls / sizeof controls[0];

static int is_camera(const char *path, int flags) {
    char *real = path && (flags & O_NONBLOCK) && (flags & O_RDWR) ? realpath(path, NULL) : NULL;
    int yes = real && strcmp(real, "/dev/null") == 0 && getenv("V4L2_CAMERA");
    free(real);
    return yes;
}

static int open_camera(void) {
    int fd = eventfd(1, 0); /* always readable: select() never waits */
    camera = fd;
    number = 0;
    n_queued = 0;
    return fd;
}

#define OPEN(NAME)                                         \
    int NAME(const char *path, int flags, ...) {           \
        va_list list;                                      \
        va_start(list, flags);                             \
        mode_t mode = va_arg(list, mode_t);                \
        va_end(list);                                      \
        if (is_camera(path, flags)) return open_camera();  \
        return syscall(SYS_openat, AT_FDCWD, path, flags, mode); \
    }
OPEN(open)
OPEN(open64)

static int fail(int number_of_error) {
    errno = number_of_error;
    return -1;
}

static unsigned fill(unsigned char *image) {
    unsigned n = width * height;
    if (format == V4L2_PIX_FMT_MJPEG) {
        FILE *file = fopen(getenv("V4L2_JPEG"), "rb");
        n = fread(image, 1, BYTES, file);
        fclose(file);
        return n;
    }
    if (format == V4L2_PIX_FMT_GREY) {
        memset(image, 10 * number % 250, n);
        return n;
    }
    for (unsigned i = 0; i < n; i++) image[2 * i] = 10 * number % 250, image[2 * i + 1] = 128;
    return 2 * n;
}

static int dequeue(struct v4l2_buffer *buffer) {
    if (access(getenv("V4L2_CAMERA"), F_OK)) return fail(ENODEV);
    if (!n_queued) return fail(EAGAIN);
    usleep(1000000 / rate);
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    buffer->index = queue[0];
    memmove(queue, queue + 1, --n_queued * sizeof queue[0]);
    buffer->bytesused = fill(memory[buffer->index]);
    buffer->length = BYTES;
    buffer->timestamp.tv_sec = now.tv_sec;
    buffer->timestamp.tv_usec = now.tv_nsec / 1000;
    if (buffer->timestamp.tv_usec < AGE_US) buffer->timestamp.tv_sec--, buffer->timestamp.tv_usec += 1000000;
    buffer->timestamp.tv_usec -= AGE_US;
    buffer->flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
    buffer->sequence = number++;
    return 0;
}

static int set_format(struct v4l2_pix_format *pix) {
    int small = pix->width <= 32;
    width = small ? 32 : 64, height = small ? 24 : 48;
    if (pix->pixelformat == V4L2_PIX_FMT_GREY || pix->pixelformat == V4L2_PIX_FMT_MJPEG) format = pix->pixelformat;
    else format = V4L2_PIX_FMT_YUYV;
    pix->width = width, pix->height = height, pix->pixelformat = format, pix->field = V4L2_FIELD_NONE;
    pix->bytesperline = format == V4L2_PIX_FMT_GREY ? width : 2 * width, pix->sizeimage = BYTES;
    return 0;
}

static int query_control(struct v4l2_queryctrl *query) {
    unsigned asked = query->id & ~V4L2_CTRL_FLAG_NEXT_CTRL;
    for (int i = 0; i < n_controls; i++) {
        int found = query->id & V4L2_CTRL_FLAG_NEXT_CTRL ? controls[i].id > asked : controls[i].id == asked;
        if (!found) continue;
        memset(query, 0, sizeof *query);
        query->id = controls[i].id, query->type = controls[i].type, query->step = 1;
        query->minimum = controls[i].low, query->maximum = controls[i].high;
        strcpy((char *)query->name, controls[i].name);
        return 0;
    }
    return fail(EINVAL);
}

static int set_control(const struct v4l2_control *control) {
    FILE *log = fopen(getenv("V4L2_LOG"), "a");
    fprintf(log, "%x %d\n", control->id, control->value);
    fclose(log);
    return 0;
}

int ioctl(int fd, unsigned long request, ...) {
    va_list list;
    va_start(list, request);
    void *argument = va_arg(list, void *);
    va_end(list);
    if (fd != camera) return syscall(SYS_ioctl, fd, request, argument);
    struct v4l2_buffer *buffer = argument;
    switch (request & 0xffffffff) {
    case VIDIOC_QUERYCAP: {
        struct v4l2_capability *answer = argument;
        memset(answer, 0, sizeof *answer);
        strcpy((char *)answer->card, "Test camera");
        answer->capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING | V4L2_CAP_DEVICE_CAPS;
        answer->device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
        return 0;
    }
    case VIDIOC_G_FMT: {
        struct v4l2_format *answer = argument;
        answer->fmt.pix.width = width, answer->fmt.pix.height = height, answer->fmt.pix.pixelformat = format;
        return set_format(&answer->fmt.pix);
    }
    case VIDIOC_TRY_FMT:
    case VIDIOC_S_FMT: return set_format(&((struct v4l2_format *)argument)->fmt.pix);
    case VIDIOC_G_PARM:
    case VIDIOC_S_PARM: {
        struct v4l2_captureparm *capture = &((struct v4l2_streamparm *)argument)->parm.capture;
        if ((request & 0xffffffff) == VIDIOC_S_PARM && capture->timeperframe.numerator)
            rate = capture->timeperframe.denominator / capture->timeperframe.numerator;
        capture->capability = V4L2_CAP_TIMEPERFRAME;
        capture->timeperframe.numerator = 1, capture->timeperframe.denominator = rate;
        return 0;
    }
    case VIDIOC_REQBUFS: {
        struct v4l2_requestbuffers *asked = argument;
        if (asked->count > MOST_BUFFERS) asked->count = MOST_BUFFERS;
        for (unsigned i = 0; i < asked->count; i++)
            if (!memory[i]) memory[i] = mmap(NULL, BYTES, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        return 0;
    }
    case VIDIOC_QUERYBUF:
        buffer->length = BYTES, buffer->m.offset = buffer->index * BYTES;
        return 0;
    case VIDIOC_QBUF:
        queue[n_queued++] = buffer->index;
        return 0;
    case VIDIOC_DQBUF: return dequeue(buffer);
    case VIDIOC_STREAMON: return 0;
    case VIDIOC_STREAMOFF:
        n_queued = 0;
        return 0;
    case VIDIOC_QUERYCTRL: return query_control(argument);
    case VIDIOC_S_CTRL: return set_control(argument);
    default: return fail(EINVAL);
    }
}

#define MMAP(NAME, OFFSET)                                                                         \
    void *NAME(void *at, size_t length, int how, int flags, int fd, OFFSET offset) {               \
        if (fd < 0 || fd != camera) return (void *)syscall(SYS_mmap, at, length, how, flags, fd, offset); \
        return memory[offset / BYTES] = (void *)syscall(                                           \
            SYS_mmap, NULL, BYTES, how | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);          \
    }
MMAP(mmap, off_t)
MMAP(mmap64, off64_t)
