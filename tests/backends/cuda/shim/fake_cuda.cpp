/* NVRTC and the driver of two GPUs on a CPU, as far as psdmc calls them. NVRTC compiles with g++ and the shim. Work on a stream
   waits until something asks for it, and only memory from cuMemAlloc is a GPU's. */
#include <dlfcn.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <fstream>
#include <functional>
#include <map>
#include <string>
#include <vector>

#define API extern "C" int
enum { OK = 0, INVALID_VALUE = 1, INVALID_CONTEXT = 201, NOT_FOUND = 500, GPUS = 2 };

struct Program {
    std::string source, code, log;
};
struct Kernel {
    void (*run)(unsigned, unsigned, void **);
    int arguments;
};
static std::vector<intptr_t> contexts;
static std::map<uintptr_t, std::pair<size_t, int>> memory;
static std::map<intptr_t, std::vector<std::function<void()>>> streams;
static int compiled;

API nvrtcGetNumSupportedArchs(int *count) { return *count = 2, OK; }
API nvrtcGetSupportedArchs(int *archs) { return archs[0] = 80, archs[1] = 90, OK; }
extern "C" const char *nvrtcGetErrorString(int) { return "an error of the fake NVRTC"; }
API nvrtcCreateProgram(Program **made, const char *source, const char *, int, void *, void *)
{
    return *made = new Program{source, "", ""}, OK;
}
API nvrtcDestroyProgram(Program **program) { return delete *program, OK; }
API nvrtcCompileProgram(Program *program, int count, const char **words)
{
    const std::string path = std::string(getenv("FAKE_CUDA_FOLDER")) + "/" + std::to_string(compiled++);
    std::string command = getenv("FAKE_CUDA_CXX"), text = program->source;
    if (count != 2 || strcmp(words[0], "--gpu-architecture=sm_90") || strncmp(words[1], "-D", 2)) {
        return program->log = "wrong words", 1;
    }
    const std::string begin = "extern \"C\" __global__ void ";
    for (size_t at = text.find(begin); at != std::string::npos; at = program->source.find(begin, at + 1)) {
        const size_t name = program->source.find(") ", at) + 2, open = program->source.find('(', name);
        const std::string own = program->source.substr(name, open - name);
        int arguments = 1;
        for (size_t k = open; program->source[k] != ')'; k++) {
            arguments += program->source[k] == ',';
        }
        text += "extern \"C\" { int " + own + "_arguments = " + std::to_string(arguments) + "; void " + own +
                "_on_cpu(unsigned blocks, unsigned threads, void **given) { cudaLaunchKernel(" + own +
                ", dim3(blocks), dim3(threads), given, 0, 0); } }\n";
    }
    std::ofstream(path + ".cu") << text;
    command += std::string(" ") + words[1] + " -o " + path + ".so " + path + ".cu";
    return program->code = path + ".so", system(command.c_str()) ? 1 : OK;
}
static int size_of(const std::string &text, size_t *size) { return *size = text.size() + 1, OK; }
static int copy_of(const std::string &text, char *to) { return memcpy(to, text.c_str(), text.size() + 1), OK; }
API nvrtcGetProgramLogSize(Program *program, size_t *size) { return size_of(program->log, size); }
API nvrtcGetProgramLog(Program *program, char *to) { return copy_of(program->log, to); }
API nvrtcGetCUBINSize(Program *program, size_t *size) { return size_of(program->code, size); }
API nvrtcGetCUBIN(Program *program, char *to) { return copy_of(program->code, to); }

API cuInit(unsigned) { return getenv("FAKE_CUDA_BROKEN") ? NOT_FOUND : OK; }
API cuGetErrorString(int, const char **text) { return *text = "an error of the fake driver", OK; }
API cuDeviceGetCount(int *count) { return *count = GPUS, OK; }
API cuDeviceGet(int *device, int ordinal) { return *device = ordinal + 40, OK; }
API cuDeviceGetName(char *name, int size, int) { return strncpy(name, "no GPU", size), OK; }
API cuDeviceGetAttribute(int *value, int attribute, int)
{
    return *value = attribute == 75 ? 9 : 0, attribute == 75 || attribute == 76 ? OK : INVALID_VALUE;
}
API cuDevicePrimaryCtxRetain(void **context, int device) { return *context = (void *)(intptr_t)device, OK; }
API cuCtxPushCurrent_v2(void *context) { return contexts.push_back((intptr_t)context), OK; }
API cuCtxPopCurrent_v2(void **) { return contexts.pop_back(), OK; }

#define NEEDS_CONTEXT if (contexts.empty()) return INVALID_CONTEXT
static void finish(intptr_t stream)
{
    for (auto &work : streams[stream]) {
        work();
    }
    streams[stream].clear();
}
API cuCtxSynchronize()
{
    NEEDS_CONTEXT;
    for (auto &stream : streams) {
        finish(stream.first);
    }
    return OK;
}
API cuStreamSynchronize(void *stream)
{
    NEEDS_CONTEXT;
    return finish((intptr_t)stream), OK;
}
API cuMemAlloc_v2(uint64_t *place, size_t size)
{
    NEEDS_CONTEXT;
    *place = (uint64_t)malloc(size);
    memset((void *)*place, 255, size);
    return memory[*place] = {size, (int)contexts.back() - 40}, OK;
}
API cuMemFree_v2(uint64_t place)
{
    NEEDS_CONTEXT;
    return memory.erase(place) ? (free((void *)place), OK) : INVALID_VALUE;
}
API cuMemcpyHtoD_v2(uint64_t to, const void *from, size_t size)
{
    NEEDS_CONTEXT;
    return memcpy((void *)to, from, size), OK;
}
API cuMemcpyDtoH_v2(void *to, uint64_t from, size_t size)
{
    NEEDS_CONTEXT;
    return finish(1), memcpy(to, (void *)from, size), OK;
}
API cuMemcpyDtoDAsync_v2(uint64_t to, uint64_t from, size_t size, void *stream)
{
    NEEDS_CONTEXT;
    return streams[(intptr_t)stream].push_back([=] { memcpy((void *)to, (void *)from, size); }), OK;
}
API cuPointerGetAttribute(int *value, int attribute, uint64_t place)
{
    NEEDS_CONTEXT;
    for (auto &each : memory) {
        if (attribute == 9 && place >= each.first && place < each.first + each.second.first) {
            return *value = each.second.second, OK;
        }
    }
    return INVALID_VALUE;
}
API cuModuleLoadData(void **module, const char *code)
{
    NEEDS_CONTEXT;
    return (*module = dlopen(code, RTLD_NOW)) ? OK : NOT_FOUND;
}
API cuModuleGetFunction(Kernel **kernel, void *module, const char *name)
{
    NEEDS_CONTEXT;
    const std::string own = name;
    void *run = dlsym(module, (own + "_on_cpu").c_str()), *count = dlsym(module, (own + "_arguments").c_str());
    return run ? (*kernel = new Kernel{(void (*)(unsigned, unsigned, void **))run, *(int *)count}, OK) : NOT_FOUND;
}
API cuLaunchKernel(Kernel *kernel, unsigned x, unsigned y, unsigned z, unsigned threads, unsigned b, unsigned c,
                   unsigned shared, void *stream, void **given, void **extra)
{
    NEEDS_CONTEXT;
    if (x == 0 || y * z * b * c != 1 || threads > 128 || shared || extra || !stream) {
        return INVALID_VALUE;
    }
    std::vector<uint64_t> values;
    for (int k = 0; k < kernel->arguments; k++) {
        values.push_back(*(uint64_t *)given[k]);
    }
    streams[(intptr_t)stream].push_back([=] {
        std::vector<void *> places;
        for (auto &value : values) {
            places.push_back((void *)&value);
        }
        kernel->run(x, threads, places.data());
    });
    return OK;
}
