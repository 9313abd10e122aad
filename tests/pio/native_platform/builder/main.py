from SCons.Script import AlwaysBuild, Default, DefaultEnvironment

env = DefaultEnvironment()
env["PROGPATH"] = "$BUILD_DIR/${PROGNAME}"
program = env.BuildProgram()
AlwaysBuild(env.Alias("size", program, "size $SOURCE"))
Default([program])
